"""The words of commands: verbs, directions, turns, and what is said around them."""

from __future__ import annotations

from ...perception.phrases import PhraseTable, spelt
from .commands import Action, Direction

VERBS: PhraseTable[Action] = PhraseTable(
    {
        **spelt("put | place | set | lay | drop | move | bring | position | insert | transfer | carry", Action.PLACE),
        **spelt("put down | set down | lay down | pick and place | pick and put", Action.PLACE),
        **spelt("stack | pile", Action.STACK),
        **spelt("pick up | pick | lift | lift up | take | grab | grasp", Action.PICK_UP),
        **spelt("drag | pull", Action.DRAG),
        **spelt("push | slide | shove", Action.PUSH),
        **spelt("rotate | turn | spin | twist", Action.ROTATE),
    }
)
COURTESIES = PhraseTable(
    {
        **spelt("please | kindly | hey | hi | hello | ok | okay | robot | just | now | next | finally | also", True),
        **spelt("first | firstly | second | secondly | third | and | carefully | gently | slowly", True),
        **spelt("could you | can you | would you | will you | you should | you must | try to | go ahead and", True),
        **spelt("i want you to | i would like you to | i need you to | your task is to", True),
    }
)
"""What may stand before a verb and changes nothing."""
CLOSINGS = PhraseTable(
    spelt("please | thanks | thank you | for me | now | right now | carefully | gently | slowly", True)
)
"""What may stand at the end of a clause and changes nothing."""
SEPARATORS = PhraseTable(spelt("then | afterwards | afterward | after that | finally | lastly", True))
DIRECTIONS: PhraseTable[Direction] = PhraseTable(
    {
        **spelt("left | leftward | leftwards | to the left | towards the left", Direction.LEFT),
        **spelt("right | rightward | rightwards | to the right | towards the right", Direction.RIGHT),
        **spelt("forward | forwards | away | away from me | to the back", Direction.FORWARD),
        **spelt("back | backward | backwards | towards me | toward me | to the front", Direction.BACK),
        **spelt("closer | closer to me", Direction.BACK),
    }
)
SENSES = {"clockwise": -1.0, "cw": -1.0, "counterclockwise": 1.0, "anticlockwise": 1.0, "ccw": 1.0}
"""Sign of a rotation about the vertical, seen from above."""
BEFORE_POINT = frozenset(
    spelt("to | at | onto | on | towards | toward | in | the | of | coordinate | coordinates", True)
    | spelt("position | point | location | spot | place", True)
)
"""What may stand between an object and coordinates: "to the point (0.30, 0.10)"."""
TABLE = frozenset(spelt("table | tabletop | desk | floor | ground", True))
