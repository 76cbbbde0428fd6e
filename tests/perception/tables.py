"""Rendered tables with noise, and what is true of them: what the tests of perception look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from maniagent.envs.objects import make_object
from maniagent.envs.scene import Placement, Scene
from maniagent.envs.tabletop import TabletopEnv, TrueObject
from maniagent.geometry import FloatArray, wrap_angle
from maniagent.motion import ArmModel
from maniagent.perception.rig import Rig
from maniagent.perception.segmentation import TableView, segment
from maniagent.perception.segments import Segment
from maniagent.robots.simulated import BodyFilter
from maniagent.types import Observation

BULGING = ("eggplant", "corn", "egg", "toy", "strawberry", "carrot")
"""Thick and round kinds: their far flank is hidden, and what is seen lies towards the cameras."""
RIG = Rig(BodyFilter(ArmModel()))


@dataclass(frozen=True)
class Look:
    """One observation, what perception makes of it, and what is true."""

    observation: Observation
    view: TableView
    truth: Mapping[str, TrueObject]
    model: mujoco.MjModel
    qpos: FloatArray
    """The simulator's whole posture at that moment."""

    def segment_of(self, name: str) -> Segment:
        """The segment nearest to where the named object truly is."""
        true_xy = self.truth[name].T_base_object[:2, 3]
        return min(self.view.segments, key=lambda s: float(np.linalg.norm(s.centre[:2] - true_xy)))

    def offset(self, name: str) -> float:
        """Horizontal distance (m) from the object's true middle to that segment's."""
        return float(np.linalg.norm(self.segment_of(name).centre[:2] - self.truth[name].T_base_object[:2, 3]))


def make_env(objects: Mapping[str, Any]) -> TabletopEnv:
    """An environment with objects by name: a kind, or a mapping as in a scene file."""
    things = [{"name": name} | ({"kind": kind} if isinstance(kind, str) else kind) for name, kind in objects.items()]
    return TabletopEnv(Scene.model_validate({"objects": things}))


def look(env: TabletopEnv) -> Look:
    """See the table as it is now."""
    observation = env.observe()
    view = segment(observation, RIG)
    return Look(observation, view, env.truth(), env.model, env.data.qpos.copy())


def again(seen: Look, observation: Observation) -> Look:
    """The same table in another observation."""
    return replace(seen, observation=observation, view=segment(observation, RIG))


def draw(objects: Mapping[str, Any], seeds: Sequence[int]) -> list[Look]:
    """One look at each of several drawn layouts."""
    env = make_env(objects)
    looks = []
    for seed in seeds:
        env.reset(seed=seed)
        looks.append(look(env))
    env.close()
    return looks


def arrange(places: Mapping[str, tuple[Any, float, float, float]], seed: int = 0) -> Look:
    """One look at objects put exactly there: by name the kind (as in `make_env`), x, y (m) and yaw (degrees)."""
    env = make_env({name: kind for name, (kind, *_) in places.items()})
    layout = []
    for thing in env.scene.objects:
        _, x, y, degrees = places[thing.name]
        model = make_object(thing.kind, **thing.params)
        layout.append(Placement(thing.name, model, np.array([x, y]), float(np.radians(degrees)), model.rest_z))
    env.reset(seed=seed, options={"layout": layout})
    seen = look(env)
    env.close()
    return seen


def block(colour: str, size: float | tuple[float, float, float] = 0.03) -> dict[str, Any]:
    """A block, as in a scene file."""
    return {"kind": "block", "params": {"size": size, "colour": colour}}


def true_yaw(thing: TrueObject) -> float:
    """rad, direction of its long axis."""
    return float(np.arctan2(thing.T_base_object[1, 0], thing.T_base_object[0, 0]))


def turned(a: float, b: float) -> float:
    """rad in [0, pi/2]: the angle between two undirected lines."""
    return abs(wrap_angle(a - b, np.pi))


def with_depth(observation: Observation, name: str, depth: FloatArray | float) -> Observation:
    """The observation with another depth image in one view."""
    frame = observation.frames[name]
    other = replace(frame, depth=np.broadcast_to(np.asarray(depth, np.float32), frame.depth.shape))
    return replace(observation, frames={**observation.frames, name: other})


def miscalibrated(observation: Observation, T_error: FloatArray) -> Observation:
    """The observation as if all cameras were believed to stand elsewhere by `T_error` ((4, 4))."""
    frames = {
        name: replace(frame, T_base_camera=T_error @ frame.T_base_camera) for name, frame in observation.frames.items()
    }
    return replace(observation, frames=frames)
