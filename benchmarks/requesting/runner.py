"""The benchmark from end to end: model, prompts, folder, questions, page."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from maniagent.agents.minds import Prompts
from maniagent.models.exchange import Exchange
from maniagent.models.opening import open_model
from maniagent.models.patience import Patience
from maniagent.models.record import ExchangeRecorder

from .asker import Asker, Order
from .cases import requests
from .display import Display
from .questions import Tape
from .report import markdown
from .results import ResultsFile

PAGE = "requests.md"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is asked, of whom, and how patiently."""

    llm: str
    out: Path
    count: int = 100
    limit: int | None = None
    """The most questions of this call."""
    order: Order = "roles"
    prompts: Path | None = None
    temperature: float | None = None
    """None leaves it to the server, as in a run."""
    timeout: float = 900.0
    max_tokens: int = 1200


def run(settings: Settings) -> str:
    """Ask what is still open; the page on all that was asked so far, which also lies in the folder.

    Raises UsageError and SetupError for a model or prompts that can't be had, ModelFailure where the model is gone.
    """
    prompts, tape, record = Prompts.load(settings.prompts), Tape(), ExchangeRecorder(settings.out)
    patience = Patience(timeout=settings.timeout, max_tokens=settings.max_tokens)

    def note(exchange: Exchange) -> None:
        record(exchange)
        tape(exchange)

    model = open_model(settings.llm, patience=patience, temperature=settings.temperature, on_exchange=note)
    chosen = tuple(requests(settings.count))
    with closing(model):
        asker = Asker(model, prompts, ResultsFile(settings.out), tape, settings.temperature)

        def page() -> str:
            text = markdown(model.name, asker.lines(chosen), len(chosen))
            (settings.out / PAGE).write_text(text, encoding="utf-8")
            return text

        with Display(total=2 * len(chosen), done=len(asker.lines(chosen))) as display:
            for line in asker.ask(chosen, settings.order, settings.limit):
                display.add(line)
                page()
        return page()
