"""Files that ship with the package: the arm's MJCF."""

from pathlib import Path

WX250S_XML = Path(__file__).parent / "wx250s.xml"
"""MJCF of the WidowX-250s: primitives only, base frame on the table top, site `tcp`, keyframe `home`."""
