"""What is told to a model: texts of others, fenced and bounded, so that they are read as data."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

import numpy as np

from ...perception.viewpoint import Viewpoint
from ...types import ObjectInfo, SubtaskRecord, Verdict

MOST_REMEMBERED = 12
"""Past sub-tasks that are told; of earlier ones only how many there were."""
_BROKEN_WORD = re.compile(r"(?<=\s)\S{1,30}$")
_ARTICLE = re.compile(r"^(?:the|a|an)\s+")


def fenced(text: str, limit: int = 4000) -> str:
    """`text` without what could close a fence such as <scene>, without control characters, at most `limit` long."""
    visible = "".join(c for c in text if c == "\n" or unicodedata.category(c)[0] != "C")
    visible = visible.translate({ord("<"): "‹", ord(">"): "›"}).strip()
    if len(visible) <= limit:
        return visible
    kept = visible[: limit - 4]
    return (kept if visible[limit - 4].isspace() else _BROKEN_WORD.sub("", kept)) + " ..."


def one_line(text: str, limit: int = 200) -> str:
    """`text` fenced and on one line."""
    return fenced(" ".join(text.split()), limit)


def plain(name: str) -> str:
    """The form in which two names are the same: lower case, single spaces, no article, no quotes."""
    return _ARTICLE.sub("", " ".join(name.casefold().strip(" .\"'`").split()))


def tell_frame(viewpoint: Viewpoint) -> str:
    """How the viewer's directions lie in the robot's frame, in which coordinates are given."""
    right, away = (f"({x + 0.0:.2g}, {y + 0.0:.2g})" for x, y in np.round([viewpoint.right, viewpoint.away], 2))
    return f"Coordinates are metres in the robot's frame; there the viewer's right is {right}, away is {away}."


def tell_objects(objects: Sequence[ObjectInfo]) -> str:
    """The objects of a sub-task, one a line."""
    return "\n".join(one_line(str(thing), 300) for thing in objects)


def tell_memory(records: Sequence[SubtaskRecord], measured: str) -> str:
    """The past sub-tasks and what came of them, oldest first; `measured` is said of the last one."""
    if not records:
        return "Empty: nothing was tried yet."
    left_out = max(len(records) - MOST_REMEMBERED, 0)
    lines = [f"({left_out} earlier sub-tasks)"] if left_out else []
    lines += [_tell_record(n, record) for n, record in enumerate(records[left_out:], left_out + 1)]
    if records[-1].verdict is Verdict.INITIAL:
        lines.append(f"To be judged now is number {len(records)}.")
    return "\n".join([*lines, measured] if measured else lines)


def _tell_record(number: int, record: SubtaskRecord) -> str:
    report = record.outcome
    if report.completed:
        outcome = "the arm made every movement"
    elif not record.objects:
        outcome = f"nothing was moved: {one_line(report.reason)} ({report.stage})"
    else:
        outcome = f"broke off after {report.reached} movements: {one_line(report.reason)} ({report.stage})"
    judged = {Verdict.SUCCESS: "achieved", Verdict.FAILURE: "not achieved"}.get(record.verdict)
    verdict = f" Judged: {judged}. {one_line(record.evidence, 300)}" if judged else ""
    return f'{number}. "{one_line(record.text)}" ({", ".join(map(one_line, record.queries))}): {outcome}.{verdict}'
