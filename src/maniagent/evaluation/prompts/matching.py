"""Which true thing a name means: by kind, by colour where the library states one, by side among alikes.

One name means one thing at most, and one thing has one name at most. Where a name fits several alikes and says nothing
to tell them apart, it is taken for one that doesn't matter: only what a name really says is counted in its favour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...perception.phrases import Pick
from .names import Said, read_name

Why = Literal["unknown words", "not there"]
"""Why a name means nothing: its words are none of the lexicon's, so that a person had better look; or no such thing,
or no further one, is on the table."""


@dataclass(frozen=True)
class Thing:
    """One true thing on the table."""

    name: str
    """In its scene."""
    title: str
    """As the object library calls it: "red chili pepper"."""
    right: float
    """m to the viewer's right, from an origin that all things of a scene share."""
    away: float
    """m away from the viewer."""
    matters: bool
    """A condition of the task speaks of it."""


@dataclass(frozen=True)
class Matching:
    """What a list of names comes to."""

    meant: tuple[tuple[str, Thing], ...]
    """Names, and the thing that each means."""
    unmatched: tuple[tuple[str, Why], ...]
    missed: tuple[Thing, ...]
    """What matters and no name means."""


def match(names: Sequence[str], things: Sequence[Thing]) -> Matching:
    """Match names to things, as many as can be."""
    said = [read_name(name) for name in names]
    kinds = [read_name(thing.title) for thing in things]
    fits = np.array([[_fits(one, index, things, kinds) for index in range(len(things))] for one in said], bool)
    fits = fits.reshape(len(said), len(things))
    # Most matches first; among equally many, those with the fewest things that matter.
    gain = fits * (1.0 - 0.5 / (len(things) + 1) * np.array([thing.matters for thing in things], float))
    pairs = {int(i): int(j) for i, j in zip(*linear_sum_assignment(gain, maximize=True), strict=True) if fits[i, j]}
    named = set(pairs.values())
    return Matching(
        meant=tuple((names[i], things[j]) for i, j in sorted(pairs.items())),
        unmatched=tuple(
            (name, "unknown words" if said[i].noun is None else "not there")
            for i, name in enumerate(names)
            if i not in pairs
        ),
        missed=tuple(thing for j, thing in enumerate(things) if thing.matters and j not in named),
    )


def _fits(said: Said, index: int, things: Sequence[Thing], kinds: Sequence[Said]) -> bool:
    kind = kinds[index]
    if said.noun is None or said.noun != kind.noun or not _colours_agree(said, kind):
        return False
    alikes = [(one, other) for one, other in zip(things, kinds, strict=True) if other.noun == kind.noun]
    # "The left red pepper" may be the leftmost of all peppers, or of the red ones.
    groups = [one for one, _ in alikes], [one for one, other in alikes if _colours_agree(said, other)]
    return any(all(_is_at(side, things[index], group) for side in said.sides) for group in groups)


def _colours_agree(said: Said, kind: Said) -> bool:
    return not said.colours or not kind.colours or bool(said.colours & kind.colours)


def _is_at(side: Pick, thing: Thing, group: Sequence[Thing]) -> bool:
    """Whether a thing is that one of a group; the side of a thing that has no alikes tells nothing apart."""
    across, along = [one.right for one in group], [one.away for one in group]
    match side:
        case _ if len(group) < 2:
            return True
        case Pick.LEFT:
            return thing.right == min(across)
        case Pick.RIGHT:
            return thing.right == max(across)
        case Pick.NEAR:
            return thing.away == min(along)
        case Pick.FAR:
            return thing.away == max(along)
        case Pick.MIDDLE:
            if np.ptp(across) >= np.ptp(along):
                return min(across) < thing.right < max(across)
            return min(along) < thing.away < max(along)
