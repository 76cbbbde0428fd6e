"""From a model's text to a checked answer: the JSON is found, parsed strictly, fitted to its form, and checked."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import from_json

from .question import Question, Unfit

T = TypeVar("T", bound=BaseModel)

LONGEST = 200_000
"""Characters of an answer that are looked at."""
_MOST_STARTS = 300
"""Places at which an object is looked for, so that a text full of brackets doesn't take for ever."""
_MOST_ERRORS = 8
_THINKING = re.compile(r"<think(?:ing)?>.*?(?:</think(?:ing)?>|\Z)", re.DOTALL)


def fit(text: str, question: Question[T]) -> T:
    """The last object in `text` that fits the form of the answer and passes the question's check.

    Raises Unfit, with what to tell the model, where there is none.
    """
    text = _THINKING.sub("", text[:LONGEST])
    complaints = {}
    answer = None
    for candidate in objects(text):
        try:
            answer = _fitted(candidate, question.answer)
        except Unfit as unfit:
            complaints[candidate] = str(unfit)
    if answer is None:
        raise Unfit(_complaint(text, complaints))
    question.check(answer)
    return answer


def objects(text: str) -> Iterator[str]:
    """The outermost JSON objects in `text`, in order, whatever stands around them: prose, fences, other brackets."""
    decoder = json.JSONDecoder()
    start = text.find("{")
    for _ in range(_MOST_STARTS):
        if start < 0:
            return
        try:
            _, end = decoder.raw_decode(text, start)
        except (ValueError, RecursionError):  # no JSON, a number of thousands of digits, or too deep a nest
            start = text.find("{", start + 1)
        else:
            yield text[start:end]
            start = text.find("{", end)


def _complaint(text: str, complaints: Mapping[str, str]) -> str:
    """What is wrong with the object that was meant, which is the longest, whole or not."""
    start = text.find("{")
    if start < 0:
        return "The answer holds no JSON object."
    longest = max(complaints, key=len, default="")
    if longest and 2 * len(longest) >= len(text) - start:
        return complaints[longest]
    try:
        from_json(text[start:], allow_inf_nan=False)
    except ValueError as error:
        reason = f": {error}"
    else:
        reason = ""
    return f"The answer holds no complete JSON object{reason}."


def _fitted(candidate: str, form: type[T]) -> T:
    try:
        value = from_json(candidate, allow_inf_nan=False)
    except ValueError as error:
        raise Unfit(f"The answer is no strict JSON: {error}.") from None
    if not _finite(value):
        raise Unfit("The answer holds a number that is infinite.")
    try:
        return form.model_validate_json(candidate)
    except ValidationError as error:
        raise Unfit(_told(error)) from None


def _finite(value: Any) -> bool:
    match value:
        case float():
            return math.isfinite(value)
        case dict():
            return all(map(_finite, value.values()))
        case list():
            return all(map(_finite, value))
        case _:
            return True


def _told(error: ValidationError) -> str:
    """What doesn't fit, a line for each fault."""
    faults = error.errors(include_url=False, include_context=False)
    lines = [f"- {_place(fault['loc'])}: {fault['msg']} (you wrote {_short(fault['input'])})" for fault in faults]
    more = [f"- and {len(lines) - _MOST_ERRORS} more"] if len(lines) > _MOST_ERRORS else []
    return "\n".join(["The answer doesn't fit its form:", *lines[:_MOST_ERRORS], *more])


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(map(str, location)) or "the whole"


def _short(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 80 else f"{text[:76]} ..."
