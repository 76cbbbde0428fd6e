"""The lexicon's data file: which words there are and how the things they name look. Checked when it is read."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal, Self

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..errors import UsageError

DEFAULT = Path(__file__).with_name("lexicon.yaml")


def _ordered(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] > limits[1]:
        raise ValueError(f"the range {list(limits)} runs backwards")
    return limits


Range = Annotated[
    tuple[Annotated[float, Field(allow_inf_nan=False)], Annotated[float, Field(allow_inf_nan=False)]],
    AfterValidator(_ordered),
]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    synonyms: tuple[str, ...] = ()


class ColourWord(_Entry):
    """A region of colour space (see `colour`); what is None isn't restricted."""

    hue: Range | None = None
    """Degrees; the lower end may be negative."""
    saturation: Range | None = None
    """Chroma / (L* + 16)."""
    lightness: Range | None = None
    """L*, 0 to 100."""


class Look(BaseModel):
    """One way in which a kind of thing may look; what is None isn't restricted. The file itself explains the fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    colours: Mapping[str, Range] = {}
    """Share of the visible surface, by "red" or "red or green"."""
    length: Range | None = None
    """m, likewise width and height."""
    width: Range | None = None
    height: Range | None = None
    ratio: Range | None = None
    fill: Range | None = None


class Noun(Look, _Entry):
    """How a kind of thing looks."""

    also: tuple[Look, ...] = ()
    """Other looks that it may have as well."""
    varies: tuple[Literal["colour", "size"], ...] = ()

    @property
    def looks(self) -> tuple[Look, ...]:
        """All looks, the usual one first."""
        return (self, *self.also)

    @property
    def colour_choices(self) -> set[str]:
        """All of "red", "red or green" that any look speaks of."""
        return {choice for look in self.looks for choice in look.colours}


class Vocabulary(BaseModel):
    """All words the lexicon knows."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    colours: Mapping[str, ColourWord]
    nouns: Mapping[str, Noun]
    anything: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _colours_are_known(self) -> Self:
        for name, noun in self.nouns.items():
            for choice in noun.colour_choices:
                for colour in choice.split(" or "):
                    if colour not in self.colours:
                        raise ValueError(f"{name}: there is no colour {colour!r}")
        return self

    @model_validator(mode="after")
    def _words_mean_one_thing(self) -> Self:
        for entries in (self.colours, self.nouns):
            seen: dict[str, str] = dict.fromkeys(self.anything, "anything")
            for word, name in _spellings(entries):
                if seen.setdefault(word, name) != name:
                    raise ValueError(f"{word!r} means both {seen[word]!r} and {name!r}")
        return self

    @classmethod
    def load(cls, path: Path | None = None) -> Self:
        """Read a lexicon file; the one that comes with maniagent by default. Raises UsageError for a bad file."""
        path = path or DEFAULT
        try:
            return cls.model_validate(yaml.safe_load(path.read_text(encoding="utf-8")))
        except OSError as error:
            raise UsageError(f"Can't read {path}: {error.strerror or error}.") from error
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise UsageError(f"{path} is not valid YAML: {error}") from error
        except ValidationError as error:
            faults = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg']}" for e in error.errors()[:5])
            raise UsageError(f"{path} is no lexicon: {faults}.") from error

    def noun_spellings(self) -> dict[str, str]:
        """Every way to say a noun, with the noun; plain things map to "thing"."""
        return dict(_spellings(self.nouns)) | dict.fromkeys(self.anything, ANYTHING)

    def colour_spellings(self) -> dict[str, str]:
        """Every way to say a colour, with the colour."""
        return dict(_spellings(self.colours))


ANYTHING = "thing"
"""The noun of phrases such as "the red one"."""


def _spellings(entries: Mapping[str, _Entry]) -> Iterator[tuple[str, str]]:
    for name, entry in entries.items():
        for spelling in (name, *entry.synonyms):
            yield spelling, name


def nearest_word(word: str, known: Mapping[str, object]) -> str:
    """A hint at the known word that looks most like `word`; empty where none does."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.7)
    return f" Did you mean {near[0]!r}?" if near else ""
