"""English in, commands out: what is understood, what is refused, and with which words."""

from __future__ import annotations

import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent import tasks
from maniagent.agents.rules.commands import Action, Command, Direction, Relation
from maniagent.agents.rules.language import NeedsLanguageModel, UnclearInstruction, parse_instruction
from maniagent.errors import ReasoningFailure


def put(thing: str, relation: Relation, target: str) -> Command:
    return Command(action=Action.PLACE, object=thing, relation=relation, target=target)


def turn(thing: str, degrees: float) -> Command:
    return Command(action=Action.ROTATE, object=thing, angle=math.radians(degrees))


def shift(action: Action, thing: str, direction: Direction, metres: float) -> Command:
    return Command(action=action, object=thing, relation=Relation.TOWARDS, direction=direction, distance=metres)


def move_to(action: Action, thing: str, x: float, y: float) -> Command:
    return Command(action=action, object=thing, relation=Relation.AT, point=(x, y))


CARROT = put("carrot", Relation.ON, "plate")


@pytest.mark.parametrize(
    "text",
    [
        "put the carrot on the plate",
        "Put carrot on plate.",
        "PLACE THE CARROT ONTO THE PLATE!",
        "set the carrot down on top of the plate",
        "please lay the carrot upon the plate, thank you",
        "could you put a carrot on a plate?",
        "Hey robot, would you kindly move the carrot onto the plate for me?",
        "I want you to drop the carrot on the plate",
        "take the carrot and put it on the plate",
        "pick the carrot up, then place it onto the plate",
        "grab the carrot and put on plate",
        "pick and place the carrot on the plate",
        "pick up the carrot. Put it on the plate.",
        "put the carrot back on the plate",
        "First, put the carrot on the plate",
        "put  the\tcarrot  on the plate\n",
        "move the carrot to the plate",
    ],
)
def test_ways_to_say_the_same_thing(text: str) -> None:
    assert parse_instruction(text) == (CARROT,)


@pytest.mark.parametrize(
    ("words", "relation"),
    [
        ("on", Relation.ON),
        ("inside", Relation.IN),
        ("into", Relation.IN),
        ("next to", Relation.NEXT_TO),
        ("beside", Relation.NEXT_TO),
        ("left of", Relation.LEFT_OF),
        ("to the left of", Relation.LEFT_OF),
        ("on the right-hand side of", Relation.RIGHT_OF),
        ("in front of", Relation.IN_FRONT_OF),
        ("behind", Relation.BEHIND),
    ],
)
def test_relations(words: str, relation: Relation) -> None:
    assert parse_instruction(f"put the egg {words} the cup") == (put("egg", relation, "cup"),)


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("put the pepper in the middle onto the plate", put("pepper in the middle", Relation.ON, "plate")),
        ("put the pepper in the middle on the plate", put("pepper in the middle", Relation.ON, "plate")),
        ("put the block on the far left in the dish", put("block on the far left", Relation.IN, "dish")),
        ("put the 2nd pepper from the left on the tray", put("second pepper from the left", Relation.ON, "tray")),
        (
            "Put the block that is left of the plate in the dish",
            put("block that is left of the plate", Relation.IN, "dish"),
        ),
        (
            "put the block which is lying next to the cup on the dish on the right",
            put("block that is next to the cup", Relation.ON, "dish on the right"),
        ),
        (
            "put the egg into the cup beside the plate",
            put("egg", Relation.IN, "cup that is next to the plate"),
        ),
        (
            "take the carrot off the plate and put it into the basket",
            put("carrot that is on the plate", Relation.IN, "basket"),
        ),
        ("put the egg on the left plate", put("egg", Relation.ON, "left plate")),
        ("put the egg on the plate on the left", put("egg", Relation.ON, "plate on the left")),
        ("put the block closest to the plate in the dish", put("block closest to the plate", Relation.IN, "dish")),
        ("put any block on the plate", put("any block", Relation.ON, "plate")),
    ],
)
def test_what_describes_an_object_stays_with_its_noun(text: str, command: Command) -> None:
    assert parse_instruction(text) == (command,)


@pytest.mark.parametrize(
    "place",
    [
        "(0.3, -0.1)",
        "[0.30, -0.10]",
        "x=0.30 y=-0.1",
        "x = 0.3, y = \N{MINUS SIGN}0.1.",
        "30 cm, -10 cm",
        "(300 mm, -100mm)",
        "(30, -10) cm",
        "the point (0.3 m, -0.1 metres)",
        "the coordinates (0.30,-0.10)",
    ],
)
def test_coordinates(place: str) -> None:
    assert parse_instruction(f"drag the plate to {place}") == (move_to(Action.DRAG, "plate", 0.3, -0.1),)


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("push the plate left by 10 cm", shift(Action.PUSH, "plate", Direction.LEFT, 0.1)),
        ("slide the left block 5cm to the right", shift(Action.PUSH, "left block", Direction.RIGHT, 0.05)),
        ("pull the plate towards me by five centimetres", shift(Action.DRAG, "plate", Direction.BACK, 0.05)),
        ("move the cup 0.08 meters forward", shift(Action.PLACE, "cup", Direction.FORWARD, 0.08)),
        ("push the cup away from me by 120 mm", shift(Action.PUSH, "cup", Direction.FORWARD, 0.12)),
    ],
)
def test_directions_and_distances(text: str, command: Command) -> None:
    assert parse_instruction(text) == (command,)


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("rotate the spoon by 90 degrees clockwise", -90),
        ("rotate the spoon by 90 degrees", 90),
        ("turn the spoon counter-clockwise by 45°", 45),
        ("turn the spoon anticlockwise ninety degrees", 90),
        ("turn the spoon a quarter turn clockwise", -90),
        ("spin the spoon by half a turn", 180),
        ("rotate the spoon through -30 deg", -30),
    ],
)
def test_rotations(text: str, degrees: float) -> None:
    assert parse_instruction(text) == (turn("spoon", degrees),)


def test_radians() -> None:
    (command,) = parse_instruction("rotate the spoon by 0.5 rad clockwise")
    assert command.angle == -0.5


def test_stack_and_pick_up() -> None:
    stack = Command(action=Action.STACK, object="green block", relation=Relation.ON, target="yellow block")
    assert parse_instruction("stack the green block on the yellow block") == (stack,)
    assert parse_instruction("stack the green block on top of the yellow block") == (stack,)
    assert parse_instruction("lift the egg up") == (Command(action=Action.PICK_UP, object="egg"),)
    assert parse_instruction("pick up the egg in the cup") == (
        Command(action=Action.PICK_UP, object="egg that is in the cup"),
    )


@pytest.mark.parametrize(
    "text",
    [
        "put the carrot on the plate, then put the egg in the basket",
        "put the carrot on the plate and the egg in the basket",
        "put the carrot on the plate and put the egg in the basket",
        "Put the carrot on the plate. Afterwards, please put the egg into the basket.",
        "first put the carrot on the plate and then, carefully, put the egg in the basket",
        "put the carrot on the plate\nput the egg in the basket",
        "take the carrot and put it on the plate; take the egg and put it in the basket",
    ],
)
def test_chains(text: str) -> None:
    assert parse_instruction(text) == (CARROT, put("egg", Relation.IN, "basket"))


@pytest.mark.parametrize(
    "text",
    [
        "put the carrot and the egg on the plate",
        "put the carrot, and the egg, on the plate",
        "pick up the carrot and the egg and put them on the plate",
    ],
)
def test_several_objects_for_one_goal_are_several_commands(text: str) -> None:
    assert parse_instruction(text) == (CARROT, put("egg", Relation.ON, "plate"))


def test_it_is_the_object_of_the_clause_before() -> None:
    commands = parse_instruction("push the spoon left by 5 cm, then rotate it by 90 degrees")
    assert commands == (shift(Action.PUSH, "spoon", Direction.LEFT, 0.05), turn("spoon", 90))


@pytest.mark.parametrize(
    "text",
    [
        "I am hungry",
        "I need to write something",
        "put the ingredients needed for Menemen onto the plate",
        "lay the knife and the fork beside the plate by Western table etiquette",
        "set the table",
        "lay the table",
        "put something edible on the plate",
        "don't put the carrot on the plate",
        "put the carrot on the plate unless the egg is there",
        "put the egg on the plate or in the cup",
        "where is the carrot?",
        "the carrot is on the plate",
        "bring me the egg",
        "push the block with the spoon",
        "put the carrot that is ripe on the plate",
        "clean up",
        "then then then",
        "把胡萝卜放在盘子上",
    ],
)
def test_what_needs_judgement_is_left_to_a_language_model(text: str) -> None:
    with pytest.raises(NeedsLanguageModel, match="language model"):
        parse_instruction(text)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("put the carrot", "Where should the carrot be put"),
        ("put the carrot on the plate and the egg", "Where should the egg be put"),
        ("put the carrot on", "which object is meant after 'on'"),
        ("put on the plate", "what to put"),
        ("pick up", "what to pick up"),
        ("put it on the plate", "'it'"),
        ("put the egg in the cup, then put the carrot next to it", "which object is meant after 'next'"),
        ("put the carrot on the table", "Where on the table"),
        ("put the carrot between the plate and the cup", "can't work out"),
        ("put the carrot on the plate next to the cup", "several ways"),
        ("move the cup closer to the plate", "can't work out"),
        ("turn on the light", "noun is missing"),
        ("pick up the block next to on the plate", "noun is missing"),
        ("put both peppers on the plate", "several objects"),
        ("stack the red block next to the blue block", "On what"),
        ("rotate the spoon", "By how much"),
        ("rotate the spoon by 0 degrees", "more than 0"),
        ("rotate the spoon by 1000 degrees", "at most 360"),
        ("push the plate to the left", "how far"),
        ("push the plate by 10 cm", "one direction"),
        ("push the plate left by 10", "no unit"),
        ("push the plate left by -10 cm", "one direction"),
        ("push the plate left by 10 km", "no unit"),
        ("drag the plate to (30, 10)", "metres"),
        ("drag the plate to (0.1, 0.2, 0.3)", "three coordinates"),
        ("drag the plate to the given coordinates", "not known"),
        ("drag the plate to (0.1, 0.2) on the left", "last"),
        ("pick up the carrot, then put the egg on the plate", "put down before"),
        ("put the carrot on the plate by 90 degrees", "rotate"),
        ("", "no words"),
        (" \t\n", "no words"),
        ("?!., ...", "no words"),
        ("\x00\ud800", "no words"),
        ("put " + "very " * 60 + "big block on the plate", "too long"),
        ("x" * 100_000, "characters"),
        ("put the egg in the cup then " * 30, "more than 20 commands"),
    ],
)
def test_half_understood_commands_get_a_precise_complaint(text: str, complaint: str) -> None:
    with pytest.raises(UnclearInstruction, match=complaint):
        parse_instruction(text)


@pytest.mark.parametrize("name", tasks.names())
def test_the_tasks_own_instructions(name: str) -> None:
    task = tasks.get(name)
    instruction = task.instruction.replace("{goal}", "(0.30, 0.10)")
    if task.needs_model:
        with pytest.raises(NeedsLanguageModel):
            parse_instruction(instruction)
    else:
        assert len(parse_instruction(instruction)) == 1


# Laws -----------------------------------------------------------------------------------------------------------

_adjectives = st.sampled_from(["", "red ", "small ", "big yellow ", "leftmost ", "second "])
_nouns = st.sampled_from(["carrot", "block", "chili pepper", "plate", "dish", "one"])
_positions = st.sampled_from(["", "", " in the middle", " on the far left", " from the right"])
_relations = [relation for relation in Relation if relation not in (Relation.AT, Relation.TOWARDS)]
_asides = [f" that is {relation} the" for relation in _relations] + [" closest to the"]
_simple = st.builds("{}{}{}".format, _adjectives, _nouns, _positions)
_phrases = st.one_of(
    _simple,
    st.builds("{}{} {}".format, _simple, st.sampled_from(_asides), _simple),
    st.builds("any {}".format, _simple),
)
_micro = st.integers(-2_000_000, 2_000_000).map(lambda n: n / 1e6)
_commands = st.one_of(
    st.builds(
        Command,
        action=st.sampled_from([Action.PLACE, Action.DRAG, Action.PUSH]),
        object=_phrases,
        relation=st.sampled_from(_relations),
        target=_phrases,
    ),
    st.builds(Command, action=st.just(Action.STACK), object=_phrases, relation=st.just(Relation.ON), target=_phrases),
    st.builds(Command, action=st.just(Action.PICK_UP), object=_phrases),
    st.builds(
        Command,
        action=st.sampled_from([Action.PLACE, Action.DRAG, Action.PUSH]),
        object=_phrases,
        relation=st.just(Relation.AT),
        point=st.tuples(_micro, _micro),
    ),
    st.builds(
        Command,
        action=st.sampled_from([Action.PLACE, Action.DRAG, Action.PUSH]),
        object=_phrases,
        relation=st.just(Relation.TOWARDS),
        direction=st.sampled_from(Direction),
        distance=st.integers(1, 2_000_000).map(lambda n: n / 1e6),
    ),
    st.builds(
        Command,
        action=st.just(Action.ROTATE),
        object=_phrases,
        angle=st.integers(-360_000, 360_000).filter(bool).map(lambda n: math.radians(n / 1000)),
    ),
)


@given(_commands)
def test_canonical_text_parses_to_the_same_command(command: Command) -> None:
    assert parse_instruction(str(command)) == (command,)


@given(st.lists(_commands.filter(lambda c: c.action is not Action.PICK_UP), min_size=1, max_size=3))
def test_chained_canonical_texts_parse_to_the_same_commands(commands: list[Command]) -> None:
    text = ", then ".join(map(str, commands))
    assert parse_instruction(text) == tuple(commands)


@given(_commands)
def test_courtesy_and_case_change_nothing(command: Command) -> None:
    assert parse_instruction(f"Could you please {str(command).upper()}, thank you!") == (command,)


_fragments = st.sampled_from(
    [
        *("put", "the", "carrot", "on", "to", "in", "left", "of", "and", "then", ",", ".", "it", "by", "10 cm"),
        *("(0.3, 0.1)", "90 degrees", "that", "is", "middle", "any", "5", "x="),
    ]
)


@given(st.one_of(st.text(max_size=200), st.lists(_fragments, max_size=30).map(" ".join)))
def test_any_text_ends_in_commands_or_in_a_short_reasoning_failure(text: str) -> None:
    try:
        commands = parse_instruction(text)
    except ReasoningFailure as refusal:
        message = str(refusal)
        commands = ()
    else:
        message = ""
        assert commands
    assert len(message) < 500
    for command in commands:
        assert parse_instruction(str(command)) == (command,)


@pytest.mark.parametrize("piece", ["put ", "and ", ", ", "then ", "that is ", "(", "1", "on the ", "please ", "- "])
def test_the_longest_hostile_text_is_refused_at_once(piece: str) -> None:
    begin = time.perf_counter()
    with pytest.raises(ReasoningFailure):
        parse_instruction((piece * 1000)[:1000])
    assert time.perf_counter() - begin < 0.5


@pytest.mark.parametrize(
    "fields",
    [
        {"action": Action.PLACE, "object": "carrot"},
        {"action": Action.PICK_UP, "object": ""},
        {"action": Action.ROTATE, "object": "spoon"},
        {"action": Action.PICK_UP, "object": "egg", "relation": Relation.ON, "target": "plate"},
        {"action": Action.STACK, "object": "egg", "relation": Relation.IN, "target": "plate"},
        {"action": Action.PUSH, "object": "egg", "relation": Relation.TOWARDS, "direction": Direction.LEFT},
    ],
)
def test_a_command_with_missing_fields_cannot_be_made(fields: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="bad"):
        Command(**fields)  # type: ignore[arg-type]  # the point of the test
