"""The `marks` detector: geometry finds and numbers what stands on the table, a vision-language model names it.

No detector weights are needed, and positions come from depth, not from the model (Set-of-Mark prompting: Yang et al.
2023, arXiv:2310.11441).
"""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from functools import cache
from importlib import resources
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ...models.question import ChatModel, Picture, Question, Unfit
from ...types import Observation
from ..segmentation import TableView
from ..segments import Segment
from .pictures import draw_marks
from .protocol import Match

MAX_MARKS = 40
"""Numbers on one picture; the largest things have them."""
MIN_PIXELS = 25
"""A thing of which less is seen in the main view can't be told by looking at it."""


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Named(_Answer):
    """What one query may mean. The order of the fields is the order of thinking."""

    query: Annotated[int, Field(ge=1, le=64)]
    """Number of the query."""
    looks: Annotated[str, Field(max_length=300)]
    numbers: Annotated[tuple[int, ...], Field(max_length=MAX_MARKS)]
    """Numbers on the picture, the surest first."""


class NamedMarks(_Answer):
    """What the model says of the numbered picture."""

    found: Annotated[tuple[Named, ...], Field(max_length=64)]


class MarksDetector:
    """Asks `model` once for all queries."""

    def __init__(self, model: ChatModel) -> None:
        self._model = model

    @property
    def name(self) -> str:
        """As it is registered."""
        return "marks"

    def detect(
        self, queries: Sequence[str], view: TableView, observation: Observation
    ) -> tuple[tuple[Match, ...], ...]:
        """See `Detector`. The model gives no confidences: a score says only how early a thing was named."""
        marked = _choose(view.segments, observation.main)
        if not marked or not queries:
            return tuple(() for _ in queries)
        answer = self._model.ask(_question(queries, marked, observation))
        numbers = {named.query: named.numbers for named in answer.found}
        return tuple(
            tuple(
                Match.of(query, marked[number - 1], 1.0 / rank, observation)
                for rank, number in enumerate(numbers[i], 1)
            )
            for i, query in enumerate(queries, 1)
        )


def _choose(segments: Sequence[Segment], view: str) -> tuple[Segment, ...]:
    """Those that get a number, in their order."""
    sizes = [np.count_nonzero(segment.masks[view]) if view in segment.masks else 0 for segment in segments]
    largest = sorted(range(len(segments)), key=lambda i: -sizes[i])[:MAX_MARKS]
    return tuple(segments[i] for i in sorted(largest) if sizes[i] >= MIN_PIXELS)


def _question(queries: Sequence[str], marked: Sequence[Segment], observation: Observation) -> Question[NamedMarks]:
    frame = observation.main_frame
    instructions, question = _prompt()
    listed = "\n".join(f'<name number="{i}">{html.escape(query)}</name>' for i, query in enumerate(queries, 1))
    return Question(
        role="objects",
        instructions=instructions,
        parts=(
            "The table:",
            Picture(frame.name, frame.rgb),
            "The same with everything on it numbered:",
            Picture(f"{frame.name}-marks", draw_marks(frame.rgb, [s.masks[frame.name] for s in marked])),
            question.replace("{count}", str(len(marked))).replace("{queries}", listed),
        ),
        answer=NamedMarks,
        check=_checker(len(queries), len(marked)),
    )


def _checker(queries: int, marks: int) -> Callable[[NamedMarks], None]:
    def check(answer: NamedMarks) -> None:
        """Each query once, and only numbers that are on the picture."""
        if sorted(named.query for named in answer.found) != list(range(1, queries + 1)):
            raise Unfit(f"`found` needs exactly one entry for each name, 1 to {queries}.")
        for named in answer.found:
            if strange := [number for number in named.numbers if not 1 <= number <= marks]:
                raise Unfit(
                    f"Name {named.query}: no thing in the picture has the number {strange[0]}; 1 to {marks} do."
                )
            if len(set(named.numbers)) < len(named.numbers):
                raise Unfit(f"Name {named.query}: a number stands there twice.")

    return check


@cache
def _prompt() -> tuple[str, str]:
    """Instructions and question, which a line of three dashes parts in the file."""
    text = (resources.files(__package__) / "prompts" / "marks.md").read_text(encoding="utf-8")
    instructions, _, question = text.partition("\n---\n")
    return instructions.strip(), question.strip()
