"""Which words to ask the SceneAgent with: the paper's equation 2, measured on scenes whose truth is known.

ManiAgent (section III-A) seeks the prompt that maximises F(Recall(S, S_true), Relevance(S, T)) over scene descriptions
S. Here S is the list of names that the SceneAgent gives, by which alone later agents may speak of things; S_true comes
from the twin, for scoring alone; and F puts recall first (docs/prompts.md).
"""

from __future__ import annotations

from .runner import Watcher, score_prompts
from .scenes import SceneOf, scenes_of
from .scores import Result, Scoring
from .variants import Variant, load_variants

__all__ = ["Result", "SceneOf", "Scoring", "Variant", "Watcher", "load_variants", "scenes_of", "score_prompts"]
