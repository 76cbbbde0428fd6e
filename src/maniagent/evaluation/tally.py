"""What an evaluation wants to know of a run by the agents: counted while it goes on, judged when it is over."""

from __future__ import annotations

from collections import Counter

from ..types import Event, RunResult, RunVerdict

UNNOTICED = "unnoticed"
"""Stage of a failure that the agents took for a success."""
THINKING = "models"
"""The kind of work that language models do."""
_ROLES = {"scene": "perception", "objects": "perception", "reasoning": "reasoning", "controller": "reasoning"}
"""By the role that asks a model: the kind of work whose seconds the answer takes."""


class Tally:
    """An Observer that counts turns, failures, and what is asked of models."""

    def __init__(self) -> None:
        self.turns = 0
        self.failed_turns: Counter[str] = Counter()
        self.last_failure = ""
        """Stage of the last failure; empty where there was none."""
        self.model_calls = 0
        self.tokens = 0
        """Read and written by models."""
        self._waited: Counter[str] = Counter()  # s, for models, by kind of work
        self._first_look: float | None = None
        self._last_look = 0.0

    @property
    def robot_seconds(self) -> float:
        """Robot time from the first look to the last, s."""
        return 0.0 if self._first_look is None else self._last_look - self._first_look

    def on_event(self, event: Event) -> None:
        """Count one event."""
        match event.kind:
            case "observed":
                self.turns += 1
                self._last_look = event.data["observation"].robot.time
                if self._first_look is None:
                    self._first_look = self._last_look
            case "asked":
                self.model_calls += 1
                self.tokens += event.data["tokens_in"] + event.data["tokens_out"]
                self._waited[_ROLES.get(event.data["role"], "reasoning")] += event.data["seconds"]
            case "failed":
                self.last_failure = event.data["stage"] or "execution"
                self.failed_turns[self.last_failure] += 1

    def failure_stage(self, result: RunResult) -> str:
        """Where a run failed that did not achieve what it should."""
        if result.verdict is RunVerdict.ACHIEVED:
            return UNNOTICED
        return self.last_failure or result.verdict.value

    def seconds_by_kind(self, result: RunResult) -> dict[str, float]:
        """A run's wall seconds by the kind of work that they went into; what models took stands by itself."""
        kinds = seconds_by_kind(result)
        if self.model_calls:
            kinds = {kind: seconds - self._waited[kind] for kind, seconds in kinds.items()}
            kinds[THINKING] = float(self._waited.total())
        return kinds


def seconds_by_kind(result: RunResult) -> dict[str, float]:
    """A run's wall seconds, its stages put together by the kind of work that they are."""
    spent = dict(result.seconds)
    kinds = {
        "perception": ("scene", "detection"),
        "reasoning": ("reasoning", "control"),  # what a language model answers, or the rules instead of it
        "planning": ("planning",),
        "observe": ("observe",),
        "execution": ("execution",),
    }
    return {kind: sum(spent.get(stage, 0.0) for stage in stages) for kind, stages in kinds.items()}
