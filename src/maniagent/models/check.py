"""Is a model fit for the agents? It is asked a few small questions; nothing is taken from what it is said to do."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from pydantic import BaseModel, ConfigDict, Field

from ..errors import FormatFailure, ModelFailure
from .answers import fit
from .background import wait_for
from .chat import LiveModel
from .dialogue import Prompt
from .endpoint import Endpoint
from .exchange import Exchange, Mode, Output
from .faults import Fault
from .names import parse_name
from .patience import Patience
from .question import Picture, Question, Unfit

_COLOURS = {"red": (214, 39, 40), "green": (44, 160, 44), "blue": (31, 90, 200), "yellow": (250, 210, 30)}
_CELL, _CELLS = 128, 3
"""Pixels of a cell of the picture, and cells on a side; a cell holds at most one shape."""
_LONG = 60
"""Numbers that are written to measure speed."""

FindingName = Literal["answers", "fits", "schema", "tool", "pictures", "speed"]


@dataclass(frozen=True)
class Finding:
    """One thing that was tried."""

    name: FindingName
    ok: bool
    detail: str


@dataclass(frozen=True)
class Verdict:
    """What was found, in the order in which it was tried; what depends on something that failed isn't tried."""

    model: str
    findings: tuple[Finding, ...]
    mode: Mode
    """How the agents would have its answers enforced."""
    latency: float | None
    """Seconds until a short answer was there."""
    tokens_per_second: float | None
    """Written, in a long answer; None where the server counts no tokens."""

    def found(self, name: FindingName) -> bool:
        """Whether `name` was tried and is good."""
        return any(finding.name == name and finding.ok for finding in self.findings)

    @property
    def reachable(self) -> bool:
        """It answers at all, and takes the key."""
        return self.found("answers")

    @property
    def serves_as_llm(self) -> bool:
        """Its answers have the form that was asked for."""
        return self.found("fits")

    @property
    def serves_as_vlm(self) -> bool:
        """Likewise, and it sees what is on a picture."""
        return self.serves_as_llm and self.found("pictures")


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Sum(_Form):
    result: int


class _Greeting(_Form):
    """Names and values that nobody guesses."""

    ruby_word: Annotated[str, Field(max_length=40)]
    amber_number: int
    slate_kind: Literal["warm", "cold"]


class _Shapes(_Form):
    count: int
    colours: Annotated[list[str], Field(max_length=20)]


class _Numbers(_Form):
    numbers: Annotated[list[int], Field(max_length=2 * _LONG)]


_SUM = Question("check", "You answer questions.", ("What is 17 + 25?",), _Sum)
_SHAPES_ASKED = (
    "The picture shows coloured shapes on white. How many are there, and which colour has each of them? "
    f"The colours are {', '.join(_COLOURS)}; name a colour once for each shape that has it."
)
_NUMBERS = Question("check", "You do as you are told.", (f"Write down the whole numbers from 1 to {_LONG}.",), _Numbers)


def check_model(
    name: str,
    base_url: str | None = None,
    *,
    output: Output = "auto",
    timeout: float = 60.0,
    seed: int | None = None,
    on_finding: Callable[[Finding], None] = lambda _: None,
) -> Verdict:
    """Ask the model named "provider:model" a few small questions; each may take `timeout` seconds.

    `seed` fixes the picture that is shown. Raises what `open_model` raises; what the model does wrong is a finding.
    """
    exchanges: list[Exchange] = []
    patience = Patience(timeout=timeout, retries=1, repairs=1, max_tokens=2048)
    endpoint = Endpoint(parse_name(name, base_url))
    model = LiveModel(endpoint, output=output, patience=patience, on_exchange=exchanges.append)
    findings: list[Finding] = []

    def found(finding: Finding) -> Finding:
        findings.append(finding)
        on_finding(finding)
        return finding

    try:
        latency, speed = None, None
        if found(_answers(model)).ok:
            latency = exchanges[-1].seconds
            fits = found(_fits(exchanges[-1])).ok
            found(_enforced(endpoint, "schema", patience))
            found(_enforced(endpoint, "tool", patience))
            found(_sees(model, random.Random(seed)))  # noqa: S311 - a picture, no secret
            if fits:
                found(_speed(model))
                speed = _tokens_per_second(exchanges[-1])
    finally:
        model.close()
    return Verdict(model.name, tuple(findings), model.mode, latency, speed)


def _answers(model: LiveModel) -> Finding:
    try:
        model.ask(_SUM)
    except ModelFailure as failure:
        return Finding("answers", False, str(failure))
    except FormatFailure:
        pass  # it did answer; `fits` says what is wrong with it
    return Finding("answers", True, model.name)


def _fits(exchange: Exchange) -> Finding:
    if exchange.answer is None:
        return Finding("fits", False, exchange.error)
    right = "right" if exchange.answer == {"result": 42} else f"in form, but wrong: {exchange.answer['result']}"
    return Finding("fits", True, f"{right}, {'after a repair' if exchange.repairs else 'at once'} ({exchange.mode})")


def _enforced(endpoint: Endpoint, mode: Mode, patience: Patience) -> Finding:
    """Whether the form is kept although the words ask for something else and don't mention it."""
    name: FindingName = "tool" if mode == "tool" else "schema"
    if mode == "schema" and not endpoint.schemas:
        return Finding(name, False, "not offered by the provider")
    prompt = Prompt("You are friendly.", ("Greet me in one short sentence.",), _Greeting)
    question = Question("check", prompt.instructions, prompt.parts, _Greeting)
    try:
        sent = endpoint.send(prompt, mode, max_tokens=patience.max_tokens, timeout=patience.timeout, tell_schema=False)
        fit(wait_for(sent).text, question)
    except Fault as fault:
        return Finding(name, False, f"{'refused' if fault.kind == 'refused' else 'no answer'}: {fault}")
    except Unfit as unfit:
        return Finding(name, False, f"not kept: {str(unfit).splitlines()[0]}")
    return Finding(name, True, "kept, without being told in words")


def _sees(model: LiveModel, rng: random.Random) -> Finding:
    colours = rng.choices(list(_COLOURS), k=rng.randint(3, 6))
    question = Question("check", "You look closely.", (_SHAPES_ASKED, Picture("shapes", draw(colours, rng))), _Shapes)
    try:
        seen = model.ask(question)
    except (ModelFailure, FormatFailure) as failure:
        return Finding("pictures", False, str(failure))
    told = [colour.strip().lower() for colour in seen.colours]
    if seen.count == len(colours) and Counter(told) == Counter(colours):
        return Finding("pictures", True, f"saw all {len(colours)} shapes")
    return Finding("pictures", False, f"shown {_listed(colours)}; told {seen.count}: {_listed(told)}")


def _speed(model: LiveModel) -> Finding:
    try:
        written = model.ask(_NUMBERS)
    except (ModelFailure, FormatFailure) as failure:
        return Finding("speed", False, str(failure))
    return Finding("speed", True, f"wrote {len(written.numbers)} numbers")


def _tokens_per_second(exchange: Exchange) -> float | None:
    return exchange.tokens_out / exchange.seconds if exchange.tokens_out and exchange.answer is not None else None


def _listed(words: list[str]) -> str:
    return ", ".join(sorted(words)) or "nothing"


def draw(colours: list[str], rng: random.Random) -> NDArray[np.uint8]:
    """(H, W, 3): a disc or a square of each colour, in a cell of its own, on white."""
    side = _CELL * _CELLS
    image = Image.new("RGB", (side, side), "white")
    pen = ImageDraw.Draw(image)
    for colour, cell in zip(colours, rng.sample(range(_CELLS**2), len(colours)), strict=True):
        x, y = _CELL * (cell % _CELLS), _CELL * (cell // _CELLS)
        box = (x + 24, y + 24, x + _CELL - 24, y + _CELL - 24)
        (pen.ellipse if rng.random() < 0.5 else pen.rectangle)(box, fill=_COLOURS[colour])
    return np.asarray(image, dtype=np.uint8)
