"""Objects for the tabletop: procedural meshes and textures to be seen, convex pieces to be felt.

>>> spec = mujoco.MjSpec()
>>> attach(spec, make_object("block", size=0.03, colour="yellow"), "target")
"""

from .bodies import attach
from .catalogue import make_object, object_names
from .model import ObjectModel

__all__ = ["ObjectModel", "attach", "make_object", "object_names"]
