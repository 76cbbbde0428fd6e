"""A comparison of prompts as a table, as Markdown, as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..tables import Table, markdown_table
from .drawing import MISSES, picture_of
from .scores import Result, Scoring, VariantScore
from .variants import PACKAGED

SUMMARY, MARKDOWN = "summary.json", "summary.md"


def write(scoring: Scoring) -> None:
    """Write summary.json and summary.md into the comparison's folder."""
    plain = json.dumps(to_plain(scoring), ensure_ascii=False, allow_nan=False, indent=2)
    (scoring.out / SUMMARY).write_text(plain + "\n", encoding="utf-8")
    (scoring.out / MARKDOWN).write_text(markdown(scoring), encoding="utf-8")


def score_table(scoring: Scoring) -> Table:
    """A row for each prompt; narrow enough for a terminal of 80 columns."""
    head = ("prompt", "recall %", "relevance %", "real %", "all %", "complete", "failed", "better", "worse")
    return Table(head, tuple(map(_row, scoring.scores)))


def _row(score: VariantScore) -> tuple[str, ...]:
    shares = (score.recall, score.relevance, score.real, score.coverage)
    compared = ("", "") if score.name == PACKAGED else (str(score.better), str(score.worse))
    complete = f"{score.complete} of {score.scenes}"
    return (score.name, *(f"{100 * share:.1f}" for share in shares), complete, str(score.failed), *compared)


def verdict(scoring: Scoring) -> str:
    """Which prompt wins, in a sentence."""
    if len(scoring.scores) < 2:
        return "One prompt alone wins over nobody: name others to compare it with."
    if scoring.winner is None:
        return "No scene was finished with every prompt."
    kept = "; nothing is gained by changing it" if scoring.winner == PACKAGED else ""
    return f"{scoring.winner!r} wins by recall, then relevance{kept}."


def markdown(scoring: Scoring) -> str:
    """summary.md."""
    tried = scoring.scores[0].scenes
    parts = [
        "# Prompts for the scene",
        f"{scoring.model}, {tried} of {scoring.scenes} scenes. Recall: what matters and was named, of what matters. "
        "Relevance: names of what matters, of all names. Real: names of what is there, of all names. All: what was "
        "named, of all that is there. These are means over the scenes. Complete: scenes of which nothing that matters "
        "was missed. Failed: no answer that fits. Better and worse: on how many scenes than the packaged prompt.",
        markdown_table(score_table(scoring)),
        verdict(scoring),
    ]
    if failed := [result for result in scoring.results if result.answer.failure]:
        rows = tuple((r.answer.scene, r.answer.variant, r.answer.failure) for r in failed)
        parts += ["## No answer that fits", markdown_table(Table(("scene", "prompt", "why"), rows))]
    if missed := [result for result in scoring.results if result.matching.missed]:
        parts += ["## What matters and was missed", markdown_table(_missed(missed)), *_pictures(scoring)]
    if unmatched := _unmatched(scoring):
        note = (
            "Unknown words: the lexicon has no such kind, so that the thing may well be there; look. Not there: no "
            "such thing, or no further one."
        )
        head = ("scene", "prompt", "name", "why")
        parts += ["## Names that mean nothing there", note, markdown_table(Table(head, unmatched))]
    return "\n\n".join(parts) + "\n"


def _missed(results: list[Result]) -> Table:
    rows = (
        (
            result.answer.scene,
            result.answer.variant,
            ", ".join(thing.name for thing in result.matching.missed),
            ", ".join(result.answer.names),
        )
        for result in results
    )
    return Table(("scene", "prompt", "missed", "named"), tuple(rows))


def _pictures(scoring: Scoring) -> list[str]:
    scenes = dict.fromkeys(result.answer.scene for result in scoring.results if result.matching.missed)
    return [f"![{scene}]({MISSES}/{scene}.png)" for scene in scenes if picture_of(scoring.out, scene).exists()]


def _unmatched(scoring: Scoring) -> tuple[tuple[str, str, str, str], ...]:
    return tuple(
        (result.answer.scene, result.answer.variant, name, why)
        for result in scoring.results
        for name, why in result.matching.unmatched
    )


def to_plain(scoring: Scoring) -> dict[str, Any]:
    """It as plain JSON data."""
    return {
        "model": scoring.model,
        "out": str(scoring.out),
        "complete": scoring.complete,
        "scenes": scoring.scenes,
        "winner": scoring.winner,
        "variants": [asdict(score) for score in scoring.scores],
        "results": [_plain_result(result, scoring.out) for result in scoring.results],
    }


def _plain_result(result: Result, out: Path) -> dict[str, Any]:
    missed = [thing.name for thing in result.matching.missed]
    picture = picture_of(out, result.answer.scene)
    return {
        "scene": result.answer.scene,
        "variant": result.answer.variant,
        "recall": result.recall,
        "relevance": result.relevance,
        "named": {name: thing.name for name, thing in result.matching.meant},
        "missed": missed,
        "unmatched": dict(result.matching.unmatched),
        "failure": result.answer.failure,
        "seconds": result.answer.seconds,
        "picture": str(picture.relative_to(out)) if missed and picture.exists() else None,
    }
