"""The rules' next sub-task, fed with made-up looks and memories."""

import pytest

from maniagent import tasks
from maniagent.agents.memory import Memory
from maniagent.agents.rules.reasoning import MAX_ATTEMPTS, MAX_BLIND_ATTEMPTS, RulesReasoningAgent
from maniagent.testing import made_object
from maniagent.types import ExecutionReport, ObjectInfo, SceneDescription, Subtask, SubtaskRecord, Verdict

EGG = made_object(0, "egg", (0.20, 0.15), size=(0.05, 0.04, 0.04), colour=(230, 210, 180))
CORN = made_object(0, "corn", (0.20, -0.15), size=(0.12, 0.04, 0.04), colour=(230, 190, 40))
PLATE = made_object(1, "plate", (0.32, 0.0), size=(0.2, 0.2, 0.008), colour=(240, 240, 240), grasps=0)
BOTH = "put the egg on the plate, then put the corn on the plate"
SLIPPED = ExecutionReport(completed=False, reached=2, reason="It slipped.", stage="grasp")
UNSEEN = ExecutionReport(completed=False, reached=0, reason="No egg is in view.", stage="detection")


def on_plate(thing: ObjectInfo, along: float = 0.0) -> ObjectInfo:
    return made_object(0, thing.name, (0.32 + along, 0.0), size=tuple(thing.extent), base_z=0.008, colour=thing.colour)


def scene(*objects: ObjectInfo) -> SceneDescription:
    return SceneDescription("made up", objects)


def next_subtask(instruction: str, now: SceneDescription, memory: Memory) -> Subtask:
    """As the loop does it: the verdict goes into memory."""
    subtask = RulesReasoningAgent().next_subtask(instruction, now, memory)
    memory.judge_last(subtask.previous, subtask.reason)
    return subtask


def attempt(memory: Memory, subtask: Subtask, *objects: ObjectInfo, outcome: ExecutionReport | None = None) -> None:
    outcome = outcome or ExecutionReport(completed=True, reached=6)
    memory.add(SubtaskRecord(subtask.text, objects, outcome, queries=subtask.objects))


def test_commands_are_named_one_by_one_in_their_order_until_all_is_done() -> None:
    memory = Memory()
    first = next_subtask(BOTH, scene(EGG, CORN, PLATE), memory)
    assert (first.text, first.objects, first.previous) == (
        "put the egg on the plate", ("egg", "plate"), Verdict.INITIAL,
    )  # fmt: skip
    attempt(memory, first, EGG, PLATE)
    second = next_subtask(BOTH, scene(on_plate(EGG), CORN, PLATE), memory)
    assert (second.text, second.objects, second.previous) == (
        "put the corn on the plate", ("corn", "plate"), Verdict.SUCCESS,
    )  # fmt: skip
    attempt(memory, second, CORN, PLATE)
    end = next_subtask(BOTH, scene(on_plate(EGG), on_plate(CORN, 0.05), PLATE), memory)
    assert end.done
    assert end.previous is Verdict.SUCCESS
    assert [record.verdict for record in memory] == [Verdict.SUCCESS, Verdict.SUCCESS]


def test_a_command_is_repeated_until_a_look_shows_it_done() -> None:
    memory = Memory()
    for _ in range(2):
        attempt(memory, next_subtask(BOTH, scene(EGG, CORN, PLATE), memory), EGG, PLATE, outcome=SLIPPED)
    assert [record.text for record in memory] == ["put the egg on the plate"] * 2
    subtask = next_subtask(BOTH, scene(on_plate(EGG), CORN, PLATE), memory)
    assert subtask.text == "put the corn on the plate"


@pytest.mark.parametrize(
    ("outcome", "objects", "allowed"), [(SLIPPED, (EGG, PLATE), MAX_ATTEMPTS), (UNSEEN, (), MAX_BLIND_ATTEMPTS)]
)
def test_it_gives_up_after_so_many_attempts_and_says_why(
    outcome: ExecutionReport, objects: tuple[ObjectInfo, ...], allowed: int
) -> None:
    memory = Memory()
    subtask = next_subtask(BOTH, scene(EGG, CORN, PLATE), memory)
    while not subtask.cannot:
        attempt(memory, subtask, *objects, outcome=outcome)
        subtask = next_subtask(BOTH, scene(EGG, CORN, PLATE), memory)
    assert len(memory) == allowed
    assert outcome.reason in subtask.reason


def test_every_command_gets_its_own_attempts() -> None:
    memory = Memory()
    for now, objects in ((scene(EGG, CORN, PLATE), (EGG, PLATE)), (scene(on_plate(EGG), CORN, PLATE), (CORN, PLATE))):
        for _ in range(MAX_ATTEMPTS - 1):
            subtask = next_subtask(BOTH, now, memory)
            assert not subtask.cannot
            attempt(memory, subtask, *objects, outcome=SLIPPED)
    assert not next_subtask(BOTH, scene(on_plate(EGG), CORN, PLATE), memory).cannot


def test_an_attempt_judged_a_success_is_not_judged_again_by_the_next_command() -> None:
    memory = Memory()
    attempt(memory, next_subtask(BOTH, scene(EGG, CORN, PLATE), memory), EGG, PLATE)
    looks = [next_subtask(BOTH, scene(on_plate(EGG), CORN, PLATE), memory) for _ in range(2)]
    assert looks[0] == looks[1]
    assert memory.records[0].verdict is Verdict.SUCCESS


@pytest.mark.parametrize("name", [name for name in tasks.names() if tasks.get(name).needs_model])
def test_what_takes_common_sense_is_refused_at_once_and_names_what_is_missing(name: str) -> None:
    subtask = next_subtask(tasks.get(name).instruction, scene(EGG, CORN, PLATE), Memory())
    assert subtask.cannot
    assert "needs a language model" in subtask.reason


@pytest.mark.parametrize(
    "instruction",
    ["put the egg", "put the egg on the plate by 3 degrees", "?!", "\x00\x07", "<b>put</b>", "egg " * 3000, "🥚"],
)
def test_what_is_half_understood_or_not_at_all_is_refused_with_a_reason(instruction: str) -> None:
    subtask = next_subtask(instruction, scene(EGG, PLATE), Memory())
    assert subtask.cannot
    assert 10 < len(subtask.reason) < 500


def test_the_longest_names_that_are_read_fit_into_sub_tasks_and_reasons() -> None:
    instruction = "put the " + "big " * 38 + "egg on the " + "flat " * 30 + "plate"
    memory = Memory()
    subtask = next_subtask(instruction, scene(EGG, PLATE), memory)
    while not subtask.cannot:
        attempt(memory, subtask, EGG, PLATE, outcome=SLIPPED)
        subtask = next_subtask(instruction, scene(EGG, PLATE), memory)
    assert len(memory) == MAX_ATTEMPTS
