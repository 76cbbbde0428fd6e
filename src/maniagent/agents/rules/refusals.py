"""How the rules say no: the two refusals, and the words that tell at once that common sense is needed."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import ReasoningFailure
from ...perception.phrases import spelt


class NeedsLanguageModel(ReasoningFailure):
    """The instruction asks for knowledge or judgement that no rule holds."""

    def __init__(self, finding: str) -> None:
        super().__init__(
            f"{finding} This needs a language model: the rules only carry out plain commands "
            "such as 'put the carrot on the plate'."
        )


class UnclearInstruction(ReasoningFailure):
    """A command the rules half understand; the message says which part is missing and how to say it."""


_CONDITIONS = frozenset(
    spelt(
        """not | never | no | nor | without | unless | if | when | whenever | until | while | except | instead | but |
        or | otherwise | because | before | after""",
        True,
    )
)
_KNOWLEDGE = frozenset(
    spelt(
        """anything | appropriate | appropriately | belong | belongs | breakfast | cook | cooking | correct | correctly
        | customary | dinner | drink | eat | edible | etiquette | favorite | favourite | for | healthy | hungry |
        ingredient | ingredients | like | lunch | matching | meal | necessary | need | needed | needs | proper |
        properly | recipe | required | same | similar | someone | something | somewhere | style | suitable | thirsty
        | unhealthy | used | useful | using | usual | usually | whose | with | write""",
        True,
    )
)
_PEOPLE = frozenset(
    spelt("i | me | my | mine | you | your | yours | us | our | we | he | she | him | her | his | they | their", True)
)
_SEVERAL = frozenset(
    spelt("all | both | each | every | everything | two | three | four | five | several | some | many | others", True)
)


def refuse_what_needs_judgement(words: Sequence[str]) -> None:
    """Raise NeedsLanguageModel where a word shows that obeying the rest literally would miss the point."""
    for word in words:
        if word in _CONDITIONS:
            raise NeedsLanguageModel(f"The instruction has a condition or an exception ('{word}').")
        if word in _KNOWLEDGE:
            raise NeedsLanguageModel(f"'{word}' asks for common sense.")


def refuse_what_names_no_object(words: Sequence[str]) -> None:
    """Raise where a noun phrase speaks of people, or of several things at once."""
    phrase = quote(words)
    for word in words:
        if word in _PEOPLE:
            raise NeedsLanguageModel(f"{phrase} speaks of a person ('{word}'), not of an object on the table.")
        if word in _SEVERAL:
            raise UnclearInstruction(
                f"{phrase} means several objects ('{word}'). Name them one by one: 'the egg and the carrot'."
            )


def quote(words: Sequence[str]) -> str:
    """`words` between quotation marks, cut to a length that is fit for a message."""
    text = " ".join(words)
    return f"'{text if len(text) <= 60 else text[:57] + '...'}'"
