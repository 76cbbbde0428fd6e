"""The cache's file under several processes, kills, and damage."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from sequences import judged, put, subtask

from maniagent.agents.cache import ActionCache, CacheStore, Kind, default_path
from maniagent.errors import SetupError, UsageError
from maniagent.types import Verdict

_WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from sequences import judged, put, subtask
from maniagent.agents.cache import ActionCache, CacheStore
from maniagent.types import Verdict
cache = ActionCache(CacheStore(Path(sys.argv[1])))
name, count = sys.argv[3], int(sys.argv[4])
print("ready", flush=True)
for number in range(count):
    text = f"put the {name} on the plate"
    cache.learn(judged(subtask(text, name, "plate"), put(name), Verdict.SUCCESS), None)
    print(number + 1, flush=True)
"""


def writer(path: Path, name: str, count: int) -> subprocess.Popen[str]:
    """A process that learns the same sub-task `count` times and says so each time."""
    command = [sys.executable, "-c", _WRITER, str(path), str(Path(__file__).parent), name, str(count)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def successes(path: Path) -> dict[tuple[Kind, str], int]:
    return {(entry.key.kind, entry.key.wording): entry.successes for entry in CacheStore(path).entries()}


@pytest.mark.slow
def test_several_processes_write_at_once_and_nothing_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "cache.sqlite"
    processes = [writer(path, name, 40) for name in ("egg", "egg", "cup")]
    assert [process.communicate(timeout=120) and process.returncode for process in processes] == [0, 0, 0]
    assert successes(path) == {
        (Kind.TEXT, "put the egg on the plate"): 80,
        (Kind.TEXT, "put the cup on the plate"): 40,
        (Kind.FORM, "put {0} on {1}"): 120,
    }


@pytest.mark.slow
def test_a_kill_in_the_middle_of_writing_costs_at_most_what_was_being_written(tmp_path: Path) -> None:
    path = tmp_path / "cache.sqlite"
    told = 0
    for _ in range(3):
        process = writer(path, "egg", 100_000)
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.15)
        os.kill(process.pid, signal.SIGKILL)
        told += len(process.communicate(timeout=60)[0].splitlines())
    assert told > 0
    counted = successes(path)
    assert told <= counted[Kind.TEXT, "put the egg on the plate"] <= told + 3
    assert told <= counted[Kind.FORM, "put {0} on {1}"] <= told + 3
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_the_file_is_made_with_its_folders_and_opens_again(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "down" / "cache.sqlite"
    ActionCache(CacheStore(path)).learn(judged(subtask(), put(), Verdict.SUCCESS), None)
    assert len(CacheStore(path, must_exist=True).entries()) == 2


def test_it_is_in_the_users_data_folder_when_nobody_says_where(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_path() == tmp_path / "maniagent" / "actions.sqlite"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_path() == tmp_path / ".local" / "share" / "maniagent" / "actions.sqlite"


def test_a_named_cache_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="There is no cache at"):
        CacheStore(tmp_path / "cache.sqlite", must_exist=True)
    assert list(tmp_path.iterdir()) == []


def damaged_header(path: Path) -> None:
    path.write_bytes(b"not a database at all" * 200)


def damaged_pages(path: Path) -> None:
    ActionCache(CacheStore(path)).learn(judged(subtask(), put(), Verdict.SUCCESS), None)
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    content = path.read_bytes()
    path.write_bytes(content[:4096] + os.urandom(len(content) - 4096))


def somebody_elses(path: Path) -> None:
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE bookmarks (url TEXT)")


def from_the_future(path: Path) -> None:
    CacheStore(path)
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 99")


def a_folder(path: Path) -> None:
    path.mkdir()


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (damaged_header, "not a database"),
        (damaged_pages, "malformed"),
        (somebody_elses, "something else"),
        (from_the_future, "version 99"),
        (a_folder, "unable to open"),
    ],
)
def test_a_file_that_is_no_cache_is_one_clear_error(tmp_path: Path, damage: object, said: str) -> None:
    path = tmp_path / "cache.sqlite"
    assert callable(damage)
    damage(path)
    before = path.read_bytes() if path.is_file() else b""
    with pytest.raises(SetupError, match=said) as error:
        CacheStore(path).entries()
    assert str(path) in str(error.value)
    assert not path.is_file() or path.read_bytes() == before, "and the file is left as it was"


@pytest.mark.parametrize(("column", "value"), [("sequence", "{}"), ("kind", "nonsense"), ("objects", "[")])
def test_a_damaged_entry_is_named_and_can_be_removed(tmp_path: Path, column: str, value: str) -> None:
    store = CacheStore(tmp_path / "cache.sqlite")
    ActionCache(store).learn(judged(subtask(), put(), Verdict.SUCCESS), None)
    with sqlite3.connect(store.path) as db:
        db.execute({
            "sequence": "UPDATE entries SET sequence = ? WHERE id = 1",
            "kind": "UPDATE entries SET kind = ? WHERE id = 1",
            "objects": "UPDATE entries SET objects = ? WHERE id = 1",
        }[column], (value,))  # fmt: skip
    with pytest.raises(SetupError, match=r"Entry 1 .* damaged.*cache rm 1"):
        store.entries()
    store.remove([1])
    assert len(store.entries()) == 1


def test_entries_are_removed_together_or_not_at_all(tmp_path: Path) -> None:
    store = CacheStore(tmp_path / "cache.sqlite")
    ActionCache(store).learn(judged(subtask(), put(), Verdict.SUCCESS), None)
    with pytest.raises(UsageError, match="no entry 7"):
        store.remove([1, 7])
    assert [entry.id for entry in store.entries()] == [1, 2]
    store.remove([1, 2])
    assert store.entries() == ()


def test_objects_names_may_hold_anything(tmp_path: Path) -> None:
    store = CacheStore(tmp_path / "cache.sqlite")
    cache = ActionCache(store)
    odd = subtask('put the "it\'s" on the 盘子', '"it\'s"', "盘子")
    cache.learn(judged(odd, put(), Verdict.SUCCESS), None)
    assert cache.find(odd) is not None
    assert json.loads(json.dumps(store.entries()[0].key.objects)) == list(odd.objects)
