"""Sub-tasks and sequences for the tests of the cache."""

from maniagent.types import (
    ActionSequence,
    ActionStep,
    ExecutionReport,
    Gripper,
    ObjectAnchor,
    Orientation,
    Part,
    PointAnchor,
    Subtask,
    SubtaskRecord,
    Verdict,
)

DONE = ExecutionReport(completed=True, reached=2)


def subtask(text: str = "put the carrot on the plate", *objects: str) -> Subtask:
    return Subtask(previous=Verdict.INITIAL, reason="", text=text, objects=objects or ("carrot", "plate"))


def put(name: str = "carrot", height: float = 0.1, point: tuple[float, float] | None = None) -> ActionSequence:
    """Take object 0 and put it onto object 1, or onto a point."""
    goal = ObjectAnchor(index=1, part=Part.SURFACE) if point is None else PointAnchor(x=point[0], y=point[1])
    take = ActionStep(
        description=f"Take the {name}",
        anchor=ObjectAnchor(index=0, part=Part.GRASP),
        orientation=Orientation(kind="grasp", index=0),
        gripper=Gripper.CLOSE,
    )
    give = ActionStep(description="Let go", anchor=goal, offset=(0, 0, height), carrying=0, gripper=Gripper.OPEN)
    return ActionSequence(skill="pick-and-place", steps=(take, give))


def judged(
    task: Subtask, sequence: ActionSequence | None, verdict: Verdict, outcome: ExecutionReport = DONE
) -> SubtaskRecord:
    return SubtaskRecord(task.text, (), outcome, verdict, "seen", task.objects, sequence=sequence)
