"""One question to one role, by the agents and the loop that a run uses, and what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from maniagent.agents.events import EventLog
from maniagent.agents.loop import AgentLoop, Budget
from maniagent.agents.memory import Memory
from maniagent.agents.minds.telling import one_line, plain
from maniagent.agents.protocols import Agents, ControllerAgent
from maniagent.agents.rules.controller import RulesControllerAgent
from maniagent.errors import FormatFailure, ModelFailure
from maniagent.models.exchange import Exchange
from maniagent.types import Event, ExecutionReport, KeyPoint, Observation, SceneDescription, Subtask

from .cases import Request
from .results import Line
from .table import Table
from .watch import Door, sequence_faults

ONE_TURN = Budget(turns=1)


@dataclass
class Tape:
    """An OnExchange that keeps what was exchanged since it was last emptied."""

    exchanges: list[Exchange] = field(default_factory=list)

    def __call__(self, exchange: Exchange) -> None:
        """Keep one more."""
        self.exchanges.append(exchange)

    def emptied(self) -> tuple[Exchange, ...]:
        """What was kept, which is then forgotten."""
        kept = tuple(self.exchanges)
        self.exchanges.clear()
        return kept


def ask_reasoning(request: Request, table: Table, tape: Tape, key: str) -> Line:
    """The first turn's question. Raises ModelFailure where the model can't be asked: no answer of its."""
    tape.emptied()
    failure: FormatFailure | None = None
    subtask: Subtask | None = None
    try:
        subtask = table.reasoning.next_subtask(table.instruction, table.scene, Memory())
    except FormatFailure as error:
        failure = error
    told: dict[str, Any] = {"stage": str(failure.stage), "reason": one_line(str(failure), 500)} if failure else {}
    if subtask is not None:
        named = tuple(map(plain, subtask.objects))
        right = any(named == tuple(map(plain, meant.objects)) for meant in table.subtasks)
        kind = "done" if subtask.done else "cannot" if subtask.cannot else "act"
        told |= {"next": kind, "subtask": subtask.text, "objects": subtask.objects, "right": right}
    about = _about(request, tape.emptied())
    # It may be asked twice, the second time with measurements: the request fits where both answers do.
    told |= {"fits_first": not about["unfit"], "fits": failure is None}
    return Line(key=key, role="reasoning", asked=table.instruction, **about | told)


def ask_controller(
    request: Request, table: Table, subtask: Subtask, source: Literal["model", "rules"], tape: Tape, key: str
) -> Line:
    """One turn of the loop on that sub-task, to the movement's end in the twin. Raises ModelFailure likewise."""
    rules_pass = _rehearse(table)
    tape.emptied()
    notes = _Notes()
    _turn(table, table.door, subtask, table.controller, notes)
    exchanges = tape.emptied()
    if failed := next((e.error for e in exchanges if e.failure == "model"), ""):
        raise ModelFailure(failed)
    malformed = [*table.env.faults, *table.door.faults]
    if notes.sequence is not None:
        malformed += sequence_faults(notes.sequence, len(subtask.objects))
    if table.door.executions > (notes.sequence is not None):
        malformed.append("door: key points without a sequence that was accepted")
    if notes.sequence is not None and (not exchanges or exchanges[-1].answer is None):
        malformed.append("sequence: from no answer that fitted")
    fitting = [exchange for exchange in exchanges if exchange.answer is not None]
    return Line(
        key=key,
        role="controller",
        asked=subtask.text,
        **_about(request, exchanges),
        # Of the first question: what is asked after a refusal by the gate counts as passing it or not.
        fits_first=bool(exchanges) and not exchanges[0].complaints,
        fits=bool(exchanges) and exchanges[0].answer is not None,
        stage=notes.stage,
        reason=one_line(notes.reason, 500),
        source=source,
        objects=subtask.objects,
        sequences=len(fitting),
        passes_first=notes.sequence is not None and len(fitting) == 1,
        passes=notes.sequence is not None,
        rules_pass=rules_pass,
        executed=table.door.executions > 0,
        completed=notes.completed,
        malformed=tuple(malformed),
    )


def _about(request: Request, exchanges: Sequence[Exchange]) -> dict[str, Any]:
    complaints = [complaint for exchange in exchanges for complaint in exchange.complaints]
    return {
        "request": request.number,
        "task": request.case.task,
        "kind": request.case.kind,
        "unfit": len(complaints),
        "complaint": one_line(complaints[0], 300) if complaints else "",
        "calls": sum(exchange.attempts for exchange in exchanges),
        "tokens_in": sum(exchange.tokens_in for exchange in exchanges),
        "tokens_out": sum(exchange.tokens_out for exchange in exchanges),
        "model_seconds": round(sum(exchange.seconds for exchange in exchanges), 2),
    }


@dataclass
class _Notes:
    """What the loop tells of a turn."""

    sequence: Any = None
    """The ActionSequence that the robot accepted."""
    completed: bool = False
    stage: str = ""
    reason: str = ""

    def on_event(self, event: Event) -> None:
        """Take note."""
        match event.kind:
            case "planned":
                self.sequence, self.stage, self.reason = event.data["sequence"], "", ""
            case "executed":
                self.completed = event.data["report"].completed
            case "failed":
                self.stage, self.reason = event.data["stage"], event.data["reason"]


@dataclass(frozen=True)
class _Told:
    """The roles that aren't asked: they say what they were told to."""

    scene: SceneDescription
    subtask: Subtask

    def describe(self, instruction: str, observation: Observation) -> SceneDescription:
        """The scene, whatever is seen now."""
        return self.scene

    def next_subtask(self, instruction: str, scene: SceneDescription, memory: Memory) -> Subtask:
        """The sub-task."""
        return self.subtask


class _Rehearsal:
    """A robot that plans as the one behind the door does and doesn't move."""

    def __init__(self, door: Door) -> None:
        self.rig, self.observe, self.check = door.rig, door.observe, door.check
        self.stop, self.on_move = door.stop, door.on_move

    def execute(self, keypoints: Sequence[KeyPoint], boxes: object) -> ExecutionReport:
        """Nothing."""
        return ExecutionReport(completed=False, reached=0, reason="Only planned.", stage="control")

    def go_home(self) -> ExecutionReport:
        """It is there."""
        return ExecutionReport(completed=True, reached=0)


def _rehearse(table: Table) -> bool:
    """Whether the rules' own sequence for the rule-made sub-task binds and passes the gate."""
    notes = _Notes()
    _turn(table, _Rehearsal(table.door), table.subtasks[0], RulesControllerAgent(), notes)
    return notes.sequence is not None


def _turn(table: Table, robot: Door | _Rehearsal, subtask: Subtask, controller: ControllerAgent, notes: _Notes) -> None:
    told = _Told(table.scene, subtask)
    agents = Agents("requests", told, told, table.objects, controller)
    AgentLoop(robot, agents, EventLog([notes]), ONE_TURN).run(table.instruction)
