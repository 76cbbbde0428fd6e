"""How open-vocabulary detectors are asked."""

from __future__ import annotations

import re

_NO_WORD = re.compile(r"[^\w' -]+")
_ARTICLE = re.compile(r"^(the|a|an|this|that|my|your|every|each|all)\s+", re.IGNORECASE)


def every(query: str) -> str:
    """Ask for "every red pepper" where "The red pepper." is wanted: for all instances, without a model's markup.

    Raises ValueError where no words are left.
    """
    words = " ".join(_NO_WORD.sub(" ", query).split())
    while words != (shorter := _ARTICLE.sub("", words)):
        words = shorter
    if not words.strip(" -'_"):
        raise ValueError(f"{query[:40]!r} holds no words")
    return f"every {words}"
