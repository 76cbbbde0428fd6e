"""Agents decide from images alone: the twin's true state can't be reached from what they are handed."""

import ast
import gc
import subprocess
import sys
import types
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import maniagent
from maniagent import tasks
from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop, Budget
from maniagent.agents.protocols import Agents
from maniagent.agents.rules import rules_agents
from maniagent.envs.scene import Placement, Scene, SceneObject
from maniagent.envs.tabletop import TabletopEnv, TrueObject
from maniagent.robots.robot import Boxes
from maniagent.robots.simulated import SimulatedArm, SimulatedRobot
from maniagent.types import Event, ExecutionReport, KeyPoint, Observation

PACKAGE = Path(maniagent.__file__).parent
FORBIDDEN = (TabletopEnv, SimulatedRobot, SimulatedArm, TrueObject, Placement, Scene, SceneObject)

# What can be reached ----------------------------------------------------------------------------------------------


def reachable(roots: Iterable[object]) -> Iterator[tuple[object, str]]:
    """Everything that Python can get at from `roots`, each once, with the way to it in type names.

    Modules and classes are the same for everybody, so the walk doesn't enter them; of functions it enters closures,
    defaults and what they are bound to, not the module's globals. An array's way leads on to the buffer it views.
    """
    seen: dict[int, object] = {}
    waiting: list[tuple[object, str]] = [(root, type(root).__name__) for root in roots]
    while waiting:
        thing, way = waiting.pop()
        if id(thing) in seen or isinstance(thing, types.ModuleType | type | str | bytes | int | float):
            continue
        seen[id(thing)] = thing  # kept alive: an id must not be given twice
        yield thing, way
        waiting += [(after, f"{way} > {type(after).__name__}") for after in _referents(thing)]


def _referents(thing: object) -> Iterable[object]:
    if isinstance(thing, types.FunctionType):
        return [thing.__closure__, thing.__defaults__, thing.__kwdefaults__, thing.__dict__]
    if isinstance(thing, np.ndarray):
        return [thing.base, *(thing.ravel().tolist() if thing.dtype == object else ())]
    return [*gc.get_referents(thing), *_slots(thing)]


def _slots(thing: object) -> Iterator[object]:
    for kind in type(thing).__mro__:
        names = kind.__dict__.get("__slots__", ())
        for name in (names,) if isinstance(names, str) else names:
            if hasattr(thing, name):
                yield getattr(thing, name)


def true_state_among(roots: Iterable[object], env: TabletopEnv) -> list[str]:
    """The ways from `roots` to the twin: the environment, its model and data, views of its arrays, true objects."""
    ours = {id(env), id(env.model), id(env.data), id(env.layout)}
    bodies = env.model.nbody
    found = []
    for thing, way in reachable(roots):
        is_simulation = isinstance(thing, mujoco.MjModel | mujoco.MjData) and _bodies(thing) >= bodies
        is_view = isinstance(thing, np.ndarray) and any(
            np.shares_memory(thing, buffer) for buffer in (env.data.qpos, env.data.xpos, env.data.xmat)
        )
        if id(thing) in ours or is_simulation or is_view or isinstance(thing, FORBIDDEN):
            found.append(way)
    return found


def _bodies(simulation: mujoco.MjModel | mujoco.MjData) -> int:
    return simulation.nbody if isinstance(simulation, mujoco.MjModel) else len(simulation.xpos)


class Recorded:
    """A role that keeps everything it was handed; it doesn't hold the loop, so that nothing else is reached."""

    def __init__(self, role: object, handed: list[object]) -> None:
        self._role, self._handed = role, handed

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self._role, name)

        def recorded(*arguments: Any) -> Any:
            self._handed.extend([*arguments, method])
            return method(*arguments)

        return recorded


@pytest.fixture(scope="module")
def env() -> Iterator[TabletopEnv]:
    env = TabletopEnv(tasks.get("pepper-on-plate").scene)
    env.reset(seed=0)
    yield env
    env.close()


def test_the_true_state_is_out_of_the_agents_reach_in_a_real_run(env: TabletopEnv) -> None:
    handed: list[object] = []
    robot = SimulatedRobot(env)
    plain = rules_agents(robot.rig)
    roles = (plain.scene, plain.reasoning, plain.objects, plain.controller)
    agents = Agents(plain.name, *(Recorded(role, handed) for role in roles))
    result = AgentLoop(robot, agents, EventLog(), Budget(turns=2)).run("put the pepper on the plate")
    assert result.subtasks, "a run in which every role was asked"
    assert {type(thing).__name__ for thing in handed} >= {"Observation", "SceneDescription", "Memory", "Subtask"}
    assert true_state_among(handed, env) == []


@pytest.mark.parametrize(
    "leak",
    [
        lambda env: [{"deep": (env,)}],
        lambda env: lambda: env.data,
        lambda env: env.truth,
        lambda env: env.truth(),
        lambda env: env.data.qpos[3:],
        lambda env: SimulatedRobot(env).observe,
        lambda env: types.SimpleNamespace(layout=env.layout),
    ],
    ids=["nested", "closure", "method", "truth", "view of an array", "robot's method", "layout"],
)
def test_the_walk_would_find_a_leak(env: TabletopEnv, leak: Callable[[TabletopEnv], object]) -> None:
    assert true_state_among([leak(env)], env)


# What is imported -------------------------------------------------------------------------------------------------

ROOMS = [room for room in ("agents", "perception", "models") if (PACKAGE / room).is_dir()]


def imported(source: Path) -> set[str]:
    """Absolute names of all modules that a file of the package imports, wherever in the file."""
    package = ("maniagent", *source.relative_to(PACKAGE).parts[:-1])
    names = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, [base, node.module]))
            names |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("room", ROOMS)
def test_agents_and_perception_know_neither_the_twin_nor_the_tasks(room: str) -> None:
    sources = sorted((PACKAGE / room).rglob("*.py"))
    assert sources
    for source in sources:
        outside = {name for name in imported(source) if name.startswith(("maniagent.envs", "maniagent.tasks"))}
        assert outside == set(), source
        assert "mujoco" not in imported(source), source


def test_not_even_by_way_of_other_modules() -> None:
    code = (
        "import sys, maniagent.agents.loop, maniagent.agents.rules\n"
        "print([name for name in sys.modules if name.startswith(('maniagent.envs', 'maniagent.tasks', 'mujoco'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# What decides -----------------------------------------------------------------------------------------------------


class Scrambling(SimulatedRobot):
    """A robot that plans but doesn't move; with `scramble`, all objects are swept away right after each picture."""

    def __init__(self, env: TabletopEnv, scramble: bool) -> None:
        super().__init__(env)
        self._scramble = scramble

    def observe(self) -> Observation:
        observation = super().observe()
        if self._scramble:
            model, data = self._env.model, self._env.data
            for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
                address = model.jnt_qposadr[joint]
                data.qpos[address : address + 3] = [0.9, 0.2 * joint, 0.5]
            mujoco.mj_forward(model, data)
            assert all(thing.T_base_object[0, 3] == 0.9 for thing in self._env.truth().values())
        return observation

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        return ExecutionReport(completed=True, reached=len(keypoints))


class Decisions:
    """What the agents said, as text."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def on_event(self, event: Event) -> None:
        data = event.data
        if event.kind in ("described", "reasoned", "located", "planned"):
            parts: Sequence[object] = [data.get(key) for key in ("subtask", "objects", "sequence", "keypoints")]
            self.said.append("\n".join(map(repr, [*parts, getattr(data.get("scene"), "text", "")])))


@pytest.mark.parametrize("task", ["pepper-on-plate", "middle-pepper"])
def test_decisions_are_the_same_when_the_truth_changes_behind_the_picture(task: str) -> None:
    said = []
    for scramble in (False, True):
        env = TabletopEnv(tasks.get(task).scene)
        env.reset(seed=1)
        robot, decisions = Scrambling(env, scramble), Decisions()
        loop = AgentLoop(robot, rules_agents(robot.rig), EventLog([decisions]), Budget(turns=1))
        loop.run(tasks.get(task).instruction)
        env.close()
        said.append(decisions.said)
    assert len(said[0]) == 4
    assert said[0] == said[1]
