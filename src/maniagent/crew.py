"""Who carries out instructions, by name: the rules, or the four agents on language models.

A crew is names and numbers only, so that it can be sent to another process, written down, and said in a command. Its
models and files are opened for one run at a time.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, Self

from .agents.events import EventLog
from .agents.protocols import Agents
from .agents.rules import rules_agents
from .errors import UnknownNameError, UsageError
from .perception.rig import Rig

if TYPE_CHECKING:
    from .models.exchange import Exchange

MakeAgents = Callable[[Rig], Agents]
"""Makes the four agents for a robot, of which they are told its rig."""
RULES, MODELS = "rules", "agents"
"""The kinds of crew."""


class Crew(Protocol):
    """Makes the agents of a run."""

    @property
    def name(self) -> str:
        """By which `crew_of` finds it again."""
        ...

    def ready(self, log: EventLog, folder: Path | None) -> AbstractContextManager[MakeAgents]:
        """Everything opened that the agents of one run need; what they ask of models goes to the log and the folder.

        Raises UsageError and SetupError where something is named wrongly or missing.
        """
        ...


@dataclass(frozen=True)
class RulesCrew:
    """The rules: no model, nothing to open."""

    name: str = RULES

    def ready(self, log: EventLog, folder: Path | None) -> AbstractContextManager[MakeAgents]:
        """Nothing is opened."""
        return nullcontext(rules_agents)


@dataclass(frozen=True, kw_only=True)
class ModelCrew:
    """The four agents on models. Time-outs, budgets and prices come from the settings in force (docs/models.md)."""

    vlm: str
    """The model that is shown pictures, "provider:model"."""
    llm: str
    """The model that reasons and writes movements."""
    base_url: str = ""
    """Where models of one's own are served that name no address."""
    detector: str = "marks"
    """What finds objects; see `perception.detectors`."""
    prompts: str = ""
    """Folder with prompts of one's own; without it, those that come with maniagent."""
    cache: str = ""
    """File with action sequences that worked before; without it, every movement is written anew."""

    @classmethod
    def chosen(cls, **said: str | None) -> Self:
        """The crew with these fields; a model that isn't said is the one in the settings, or the other one.

        Raises UsageError where no model is named anywhere.
        """
        from .models.settings import load_settings

        named = {name: value for name, value in said.items() if value}
        settings = load_settings(**{name: named.get(name) for name in ("vlm", "llm", "base_url")})
        vlm, llm = settings.vlm or settings.llm, settings.llm or settings.vlm
        if vlm is None or llm is None:
            raise UsageError("No model is named: give --vlm PROVIDER:MODEL, or set MANIAGENT_VLM (docs/models.md).")
        return cls(**named | {"vlm": vlm, "llm": llm, "base_url": settings.base_url or ""})

    @property
    def name(self) -> str:
        """All of it, as the options of a command say it: "agents vlm=... llm=... detector=..."."""
        said = [(field.name, getattr(self, field.name)) for field in fields(self)]
        return " ".join([MODELS, *(f"{name}={shlex.quote(value)}" for name, value in said if value)])

    @contextmanager
    def ready(self, log: EventLog, folder: Path | None) -> Iterator[MakeAgents]:
        """The models are connected and the prompts read; every exchange is an event, and recorded in the folder."""
        from .agents.cache import ActionCache, CacheStore, with_cache
        from .agents.minds import Prompts, minds_agents
        from .models.opening import open_models
        from .models.record import ExchangeRecorder
        from .models.settings import load_settings
        from .perception.detectors.registry import make_detector

        record = ExchangeRecorder(folder) if folder is not None else None

        def note(exchange: Exchange) -> None:
            if record is not None:
                record(exchange)
            _tell(exchange, log)

        prompts = Prompts.load(Path(self.prompts) if self.prompts else None)
        settings = load_settings(vlm=self.vlm, llm=self.llm, base_url=self.base_url or None)
        with closing(open_models(settings, note)) as models:
            detector = make_detector(self.detector, models.vlm)

            def make(rig: Rig) -> Agents:
                agents = minds_agents(rig, models.vlm, models.llm, detector, prompts)
                return with_cache(agents, ActionCache(CacheStore(Path(self.cache))), log) if self.cache else agents

            yield make


def _tell(exchange: Exchange, log: EventLog) -> None:
    log.emit(
        "asked",
        turn=log.turn,
        role=exchange.role,
        model=exchange.model,
        tokens_in=exchange.tokens_in,
        tokens_out=exchange.tokens_out,
        seconds=exchange.seconds,
        repairs=exchange.repairs,
        error=exchange.error,
    )


def crew_of(name: str) -> Crew:
    """The crew that a name says: "rules", "agents" (models from the settings), or a ModelCrew's whole name.

    Raises UnknownNameError and UsageError for names that say none.
    """
    try:
        kind, *said = shlex.split(name)
        given = dict(part.split("=", 1) for part in said)
    except ValueError:
        kind, given = name, {}
    if kind == RULES and not given:
        return RulesCrew()
    if kind != MODELS:
        raise UnknownNameError("actor", kind, (RULES, MODELS))
    known = {field.name for field in fields(ModelCrew)}
    if unknown := next((key for key in given if key not in known), None):
        raise UnknownNameError("part of an actor", unknown, known)
    return ModelCrew.chosen(**given)
