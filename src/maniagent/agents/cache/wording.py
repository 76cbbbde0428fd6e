"""The normal form of a sub-task's text: what two sub-tasks share that differ in the names of their objects only.

"Put the carrot on the plate." about ("carrot", "plate") and "put an egg on the plate" about ("egg", "plate") have
the normal form "put {0} on {1}". Stated in full:

1. Case is folded; the text is cut into words, numbers and single other characters.
2. The articles a, an and the go, as do marks at the end of the sentence.
3. Every object's name, folded likewise, becomes its index in braces wherever it stands as a whole, longer names first.
   Colours, sizes and plurals are part of the name: what is no name stays as it is, word by word.

The verb, the prepositions and all numbers stay, so that no other skill and no other number of objects has the same
form. A text has none where it doesn't say which object is which: an object that the text doesn't mention, two of one
name, or one that begins the sentence, where the verb belongs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

_TOKEN = re.compile(r"\{\d+\}|\d+(?:[.,]\d+)*|[^\W\d_]+(?:['’-][^\W\d_]+)*|\S")
_PLACE = re.compile(r"\{(\d+)\}")
_ARTICLES = frozenset({"a", "an", "the"})
_END_MARKS = frozenset(".!?;,")

Tokens = tuple[str, ...]


def normal_form(text: str, queries: Sequence[str]) -> str | None:
    """The normal form of a sub-task about the objects `queries`, in the order of their indices; None without one."""
    names = [_tokens(query) for query in queries]
    if not all(names) or len(set(names)) < len(names):
        return None
    form, found, words = [], set[int](), _tokens(text)
    position = 0
    while position < len(words):
        index = _name_at(words, position, names)
        if index is None and not _PLACE.fullmatch(words[position]):
            form.append(words[position])
            position += 1
        elif index is not None and position > 0:
            found.add(index)
            form.append(place(index))
            position += len(names[index])
        else:  # a place that no object is called by, or a name where the verb belongs
            return None
    return " ".join(form) if len(found) == len(names) else None


def place(index: int) -> str:
    """What stands for object `index` in a normal form."""
    return f"{{{index}}}"


def places(count: int) -> Tokens:
    """What stands for that many objects, in the order of their indices."""
    return tuple(map(place, range(count)))


def without_names(text: str, queries: Sequence[str]) -> str:
    """A description with the objects' names replaced by their places; everything else stays as it is."""
    indices = sorted(range(len(queries)), key=lambda index: -len(queries[index]))
    pattern = "|".join(rf"(?P<n{index}>(?<!\w){re.escape(queries[index])}(?!\w))" for index in indices)
    return re.sub(pattern, lambda match: place(int(str(match.lastgroup)[1:])), text, flags=re.IGNORECASE)


def with_names(text: str, queries: Sequence[str]) -> str:
    """The inverse of `without_names` for other objects."""
    known = dict(zip(places(len(queries)), queries, strict=True))
    return _PLACE.sub(lambda match: known.get(match[0], match[0]), text)


def _tokens(text: str) -> Tokens:
    words = [token for token in _TOKEN.findall(text.casefold()) if token not in _ARTICLES]
    while words and words[-1] in _END_MARKS:
        words.pop()
    return tuple(words)


def _name_at(words: Tokens, position: int, names: Sequence[Tokens]) -> int | None:
    """Index of the longest name that stands at a position."""
    here = [index for index, name in enumerate(names) if words[position : position + len(name)] == name]
    return max(here, key=lambda index: len(names[index]), default=None)
