"""Who is evaluated, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..agents.protocols import Agents
from ..agents.rules import rules_agents
from ..errors import UnknownNameError
from ..perception.rig import Rig


@dataclass(frozen=True)
class Actor:
    """Something that carries out instructions."""

    name: str
    make_agents: Callable[[Rig], Agents]
    """Makes the four agents for a robot, of which they are told its rig."""


_ACTORS = {actor.name: actor for actor in (Actor("rules", rules_agents),)}


def names() -> tuple[str, ...]:
    """The names of all actors."""
    return tuple(_ACTORS)


def get(name: str) -> Actor:
    """The actor of that name; UnknownNameError suggests the nearest."""
    try:
        return _ACTORS[name]
    except KeyError:
        raise UnknownNameError("actor", name, _ACTORS) from None
