"""Files that ship with the package: the arm's MJCF."""

from pathlib import Path

WX250S_XML = Path(__file__).parent / "wx250s.xml"
"""MJCF of the WidowX-250s: primitives only, base frame on the table top, site `tcp`, keyframe `home`."""

JOINTS = ("waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate")
"""The arm's joints in this file, in the order of every (6,) array of joint values."""
