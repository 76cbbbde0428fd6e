"""A recorded run, read back from its folder as a story of turns; also of a run that was cut short."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import UsageError
from .folder import EVENTS, VIDEO
from .journal import read_lines

Json = dict[str, Any]

STAGES = ("observe", "scene", "reasoning", "detection", "control", "planning", "execution")
"""Stages of a turn in the order in which they happen."""

_STAGE_ENDED_BY = {
    "observed": "observe",
    "described": "scene",
    "reasoned": "reasoning",
    "located": "detection",
    "cache": "control",
    "checked": "control",
    "planned": "control",
    "homed": "execution",
    "executed": "execution",
}
_STAGE_OF_FAILURE = {"camera": "observe", "grasp": "detection", "format": "control"}
"""Failure stages that go by another name than the stage of the turn in which they show."""


@dataclass(frozen=True)
class Span:
    """A stretch of wall time spent on one stage."""

    stage: str
    start: float
    end: float

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return self.end - self.start

    @property
    def label(self) -> str:
        """The stage in words: the log can't tell writing a sequence from planning it, which go to and fro."""
        return "control and planning" if self.stage == "control" else self.stage


@dataclass
class Turn:
    """One time round the loop, as far as it came."""

    number: int
    pictures: dict[str, str] = field(default_factory=dict)
    """View names to files, relative to the run folder."""
    main_view: str = ""
    detections_picture: str = ""
    scene: Json = field(default_factory=dict)
    subtask: Json = field(default_factory=dict)
    objects: list[Json] = field(default_factory=list)
    sequence: Json = field(default_factory=dict)
    report: Json = field(default_factory=dict)
    failures: list[Json] = field(default_factory=list)
    moves: list[Json] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    video_start: float | None = None
    """s into the video at which the arm starts to move; None where it does not."""
    judged: Json = field(default_factory=dict)
    """The sub-task of the next turn, which holds the verdict on this one."""

    @property
    def picture(self) -> str:
        """The file that shows best what was seen."""
        return self.detections_picture or self.pictures.get(self.main_view, "")


@dataclass
class Story:
    """A whole run."""

    folder: Path
    start: Json
    """Data of run_started."""
    turns: list[Turn]
    finish: Json
    """Data of run_finished; empty where the run was cut short."""
    seconds: float
    """Wall time of the last event, s."""

    @property
    def video(self) -> Path | None:
        """The video, where there is one."""
        path = self.folder / VIDEO
        return path if path.is_file() and path.stat().st_size else None

    def seconds_by_stage(self) -> dict[str, float]:
        """Wall seconds by stage: as the run itself counted them, else from the times of the events."""
        counted: dict[str, float] = self.finish.get("result", {}).get("seconds", {})
        if counted:
            return counted
        totals = dict.fromkeys(STAGES, 0.0)
        for turn in self.turns:
            for span in turn.spans:
                totals[span.stage] = totals.get(span.stage, 0.0) + span.seconds
        return totals

    def failures(self) -> Iterator[tuple[str, int, str]]:
        """(stage, turn, reason) of everything that went wrong, in order, each once."""
        for turn in self.turns:
            told = dict.fromkeys((failure["stage"], failure["reason"]) for failure in turn.failures)
            if turn.report and not turn.report["completed"]:
                told[turn.report["stage"] or "execution", turn.report["reason"]] = None
            if not told and turn.judged.get("previous") == "failure":
                told["outcome", turn.judged["reason"]] = None  # all went as planned, and yet it isn't done
            for stage, reason in told:
                yield stage, turn.number, reason


def read_story(folder: Path) -> Story:
    """Read a run folder; UsageError where it is none, or where its log is damaged."""
    path = folder / EVENTS
    if not path.is_file():
        raise UsageError(f"{folder} is no run folder: {EVENTS} is missing.")
    try:
        events = read_lines(path)
    except ValueError as error:
        raise UsageError(f"The log is damaged: {error}") from error
    story = Story(folder, start={}, turns=[], finish={}, seconds=0.0)
    for event in events:
        _add(story, event)
    for turn, following in zip(story.turns, story.turns[1:], strict=False):
        turn.judged = following.subtask
    return story


def _add(story: Story, event: Json) -> None:
    before, story.seconds = story.seconds, event["time"]
    if event["kind"] == "run_started":
        story.start = event
        return
    if event["kind"] == "run_finished":
        story.finish = event
        if story.turns:  # between the last word of the agents and the end the arm goes home
            story.turns[-1].spans.append(Span("execution", before, event["time"]))
        return
    if not event.get("turn"):  # before the first turn: what the loop was given, the arm's way home
        return
    if not story.turns or story.turns[-1].number != event["turn"]:
        story.turns.append(Turn(event["turn"]))
    turn = story.turns[-1]
    stage = _stage_until(turn, event)
    if turn.spans and turn.spans[-1].stage == stage:
        turn.spans[-1] = Span(stage, turn.spans[-1].start, event["time"])
    else:
        turn.spans.append(Span(stage, before, event["time"]))
    _tell(turn, event)


def _stage_until(turn: Turn, event: Json) -> str:
    """What was going on until this event."""
    kind: str = event["kind"]
    if kind == "move":
        return "execution" if turn.moves else "planning"
    if kind == "failed":
        stage: str = event["stage"]
        return _STAGE_OF_FAILURE.get(stage, stage)
    return _STAGE_ENDED_BY.get(kind, kind)


def _tell(turn: Turn, event: Json) -> None:
    match event["kind"]:
        case "observed":
            turn.pictures, turn.main_view = event.get("files", {}), event["observation"]["main"]
        case "described":
            turn.scene = event["scene"]
        case "reasoned":
            turn.subtask = event["subtask"]
        case "located":
            turn.objects = event["objects"]
            turn.detections_picture = event.get("files", {}).get("detections", "")
        case "planned":
            turn.sequence = event["sequence"]
        case "move":
            turn.moves.append(event)
            if turn.video_start is None:
                turn.video_start = event["video_time"]
        case "executed":
            turn.report = event["report"]
        case "failed":
            turn.failures.append(event)
