"""Paraphrases of an instruction, from the settings to the dataset's tasks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from staged import stage

from maniagent.data.ledger import key_of
from maniagent.data.lerobot import Writer, publish
from maniagent.data.settings import checked_settings

SETTINGS = checked_settings(
    "carrot-on-plate", None, None, count=12, paraphrases=("carrot to plate", "serve the carrot")
)
SAID = (SETTINGS.instruction, *SETTINGS.paraphrases)
KEYS = [key_of(0, start, 1) for start in range(12)]


class TaskWriter(Writer):
    """In lerobot's place: it keeps the task that each episode is given."""

    def __init__(self) -> None:
        self.tasks: dict[str, str] = {}

    def append(
        self, dataset: Path, schema: Mapping[str, Any], episodes: Sequence[tuple[Path, str]], codec: str = ""
    ) -> float:
        (dataset / "meta").mkdir(parents=True, exist_ok=True)
        self.tasks |= {folder.name: task for folder, task in episodes}
        (dataset / "meta" / "info.json").write_text(json.dumps({**schema, "total_episodes": len(self.tasks)}))
        return 0.0


def published(collection: Path, keys: Sequence[str], writer: TaskWriter, batch: int) -> dict[str, str]:
    for key in keys:
        stage(collection / "episodes", key, instruction=SETTINGS.instruction, paraphrases=list(SETTINGS.paraphrases))
    publish(collection, writer=writer, batch=batch)
    return writer.tasks


def test_every_episode_is_given_the_instruction_or_a_paraphrase_and_all_get_their_turn(tmp_path: Path) -> None:
    tasks = published(tmp_path, KEYS, TaskWriter(), batch=25)
    assert list(tasks) == KEYS
    assert set(tasks.values()) == set(SAID)


@pytest.mark.parametrize("batch", [1, 5])
def test_which_one_it_is_depends_on_the_episode_alone(tmp_path: Path, batch: int) -> None:
    at_once = published(tmp_path / "at once", KEYS, TaskWriter(), batch=25)
    in_parts = TaskWriter()
    published(tmp_path / "in parts", KEYS[::2], in_parts, batch)  # as though the others came later, or failed first
    published(tmp_path / "in parts", KEYS[1::2], in_parts, batch)
    assert in_parts.tasks == at_once
