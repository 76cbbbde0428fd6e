"""The ObjectAgent: a detector finds, a VLM tells look-alikes apart, geometry measures and grasps (section III-C)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import DetectionFailure
from ...models.question import ChatModel, Picture, Question, Unfit
from ...perception.detectors.pictures import draw_marks
from ...perception.detectors.protocol import Match
from ...perception.identity import same_thing
from ...perception.rig import Rig
from ...perception.segments import Segment
from ...perception.viewpoint import Viewpoint
from ...types import BoolArray, Observation, Subtask
from ..locating import assemble, offer_grasps
from ..memory import Memory
from ..protocols import Located
from ..rules.controller import drag_direction
from .answers import Choice
from .eyes import Eyes
from .prompts import Prompt
from .recognition import attempts_at, recognise
from .telling import fenced, one_line

MOST_ALIKE = 12
"""Look-alikes that are numbered on one picture."""
COVERED = 0.5
"""Share of one segment's pixels that lie in another's, from which the two are one thing."""


class MindObjectAgent:
    """Locates the objects of a sub-task; the first one is the object that moves and gets grasps."""

    def __init__(self, eyes: Eyes, rig: Rig, vlm: ChatModel, prompt: Prompt) -> None:
        self._eyes = eyes
        self._rig = rig
        self._vlm = vlm
        self._prompt = prompt

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        """One object per query, in their order, and everything else as surroundings.

        Raises
        ------
        DetectionFailure
            Where a query isn't found, two mean the same thing, or none of several is the one that is meant.
        GraspFailure
            Where the object that is to be moved offers no grasp.
        ModelFailure, FormatFailure
            Where the VLM can't be asked, or gives no answer that fits.

        """
        view = self._eyes.look(observation)
        known = {
            i: Match.of(subtask.objects[i], view.segments[k], 1.0, observation)
            for i, k in recognise(subtask, memory, view.segments).items()
        }
        found = self._resolve(subtask, observation, known)
        moved = found[0].segment
        way = drag_direction(subtask.text, moved.centre[:2], Viewpoint.of(observation))
        grasps = offer_grasps(subtask.objects[0], moved, view, self._rig, attempts_at(subtask, memory), way)
        chosen = [(q, match.segment, match.detection) for q, match in zip(subtask.objects, found, strict=True)]
        others = [s for s in view.segments if not any(_covers(match.segment, s) for match in found)]
        return assemble(chosen, grasps, [(_name_of(s, memory), s) for s in others])

    def _resolve(self, subtask: Subtask, observation: Observation, known: dict[int, Match]) -> list[Match]:
        """One match per query: those that are known, the only ones, then the VLM's choice among several."""
        missing = [i for i in range(len(subtask.objects)) if i not in known]
        queries = [subtask.objects[i] for i in missing]
        candidates = dict(zip(missing, self._eyes.find(queries) if queries else (), strict=True))
        if unseen := [subtask.objects[i] for i, matches in candidates.items() if not matches]:
            raise DetectionFailure(f"The detector finds no {' and no '.join(unseen)}.")
        found = dict(known)
        for i in sorted(missing, key=lambda i: len(candidates[i])):
            free = [m for m in candidates[i] if not any(_same(m.segment, other.segment) for other in found.values())]
            if not free:
                raise DetectionFailure(f"{' and '.join(map(repr, subtask.objects))} mean the same thing.")
            found[i] = free[0] if len(free) == 1 else self._pick(subtask, subtask.objects[i], free, observation)
        return [found[i] for i in range(len(subtask.objects))]

    def _pick(self, subtask: Subtask, query: str, alikes: Sequence[Match], observation: Observation) -> Match:
        """Ask which of several things is meant, by their numbers on the main picture."""
        masks = [(match, match.segment.masks.get(observation.main)) for match in alikes]
        shown = [(match, mask) for match, mask in masks if mask is not None and mask.any()][:MOST_ALIKE]
        if not shown:
            return alikes[0]
        instructions, question = self._prompt.filled(
            query=fenced(query), subtask=fenced(subtask.text), count=str(len(shown))
        )

        def check(choice: Choice) -> None:
            if choice.number > len(shown):
                raise Unfit(f"There is no {choice.number}: the numbers go from 1 to {len(shown)}, 0 is none of them.")

        marked = Picture("alikes", draw_marks(observation.main_frame.rgb, [mask for _, mask in shown]))
        choice = self._vlm.ask(Question("objects", instructions, (marked, question), Choice, check))
        if choice.number == 0:
            raise DetectionFailure(
                f"None of {len(shown)} things found is the {one_line(query)}: {one_line(choice.reason)}"
            )
        return shown[choice.number - 1][0]


def _same(a: Segment, b: Segment) -> bool:
    return _covers(a, b) and _covers(b, a)


def _covers(whole: Segment, part: Segment) -> bool:
    """Whether `part` is, for the most part, a piece of `whole`, in a view that shows both; else by their middles."""
    if whole is part:
        return True
    for view, mask in part.masks.items():
        other: BoolArray | None = whole.masks.get(view)
        if other is not None and mask.any():
            return float((mask & other).sum()) > COVERED * float(mask.sum())
    return float(np.linalg.norm(whole.centre - part.centre)) < 0.01


def _name_of(segment: Segment, memory: Memory) -> str:
    """For a thing that nobody asked for now: what a thing of its looks was called before, and where it is."""
    seen = segment.to_object(0, "thing")
    before = (thing for record in reversed(memory.records) for thing in record.objects if same_thing(thing, seen))
    known = next(before, None)
    name = "thing" if known is None else f"what looks like the {known.name}"
    return f"{name} at ({seen.centre[0]:.2f}, {seen.centre[1]:.2f})"
