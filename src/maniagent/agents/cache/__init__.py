"""The action cache: a sub-task that was carried out before is carried out the same way again, without a model."""

from __future__ import annotations

from .controller import ActionCache, Cache, CachingController, Hit, with_cache
from .entry import Entry, Key, Kind
from .store import CacheStore, default_path

__all__ = [
    "ActionCache",
    "Cache",
    "CacheStore",
    "CachingController",
    "Entry",
    "Hit",
    "Key",
    "Kind",
    "default_path",
    "with_cache",
]
