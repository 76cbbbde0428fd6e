"""Staging: an episode is whole or it isn't there, whatever ends the process that writes it."""

from __future__ import annotations

import errno
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from staged import made_info, made_recording, stage

from maniagent.data.episode import EpisodeInfo, Recording
from maniagent.data.staging import Staging, load
from maniagent.errors import ManiAgentError, SetupError, UsageError

HERE = Path(__file__).parent
"""`python -c` finds the modules of the folder that it is started in: `staged`, too."""


def assert_same(one: Recording, other: Recording | None) -> None:
    assert other is not None
    for name, value in vars(one.steps).items():
        np.testing.assert_array_equal(value, getattr(other.steps, name), err_msg=name)
    for kind in ("rgb", "depth"):
        pictures, found = getattr(one, kind), getattr(other, kind)
        assert pictures.keys() == found.keys()
        for camera in pictures:
            np.testing.assert_array_equal(pictures[camera], found[camera])
            assert pictures[camera].dtype == found[camera].dtype


def left_in(folder: Path) -> set[str]:
    """Everything in a staging folder that isn't there from the beginning."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")} - {"quarantine"}


@pytest.mark.parametrize("depth", [False, True])
def test_what_was_committed_comes_back(tmp_path: Path, depth: bool) -> None:
    staging = Staging(tmp_path)
    info, recording = made_info("a-1"), made_recording(depth=depth)
    path = staging.commit(info, recording)
    found_info, found = load(path)
    assert found_info == info
    assert_same(recording, found)


def test_pictures_are_mapped_and_read_only(tmp_path: Path) -> None:
    _, recording = load(Staging(tmp_path).commit(made_info("a"), made_recording()))
    assert recording is not None
    assert isinstance(recording.rgb["main"], np.memmap)
    assert not recording.rgb["main"].flags.writeable


def test_the_layout_is_the_one_that_datasets_are_made_of(tmp_path: Path) -> None:
    recording = made_recording(depth=True)
    committed = Staging(tmp_path / "one").commit(made_info("a"), recording)
    described = stage(tmp_path / "other", "a", recording)
    assert sorted(path.name for path in committed.iterdir()) == sorted(path.name for path in described.iterdir())
    assert_same(recording, load(described)[1])


@given(text=st.text(st.characters(exclude_characters="\0"), max_size=40))
def test_any_text_survives(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    recording = made_recording(T=2, cameras=("main",), size=(16, 16))
    steps = type(recording.steps)(**{**vars(recording.steps), "subtasks": (text, "put it down")})
    info = made_info("a", instruction=text.encode("utf-8", "ignore").decode(), reason="-")
    path = Staging(tmp_path_factory.mktemp("staging")).commit(info, Recording(steps, recording.rgb, {}))
    found_info, found = load(path)
    assert found is not None
    assert (found_info, found.steps.subtasks) == (info, steps.subtasks)


def test_episodes_come_by_key_and_quarantine_is_apart(tmp_path: Path) -> None:
    staging = Staging(tmp_path)
    for key in ("c", "a", "b-2", "b-10"):
        staging.commit(made_info(key), made_recording(T=2))
    odd = staging.quarantine(made_info("z", label="doubtful", reason="two carrots"), made_recording(T=2))
    (tmp_path / ".draft.part").mkdir()
    assert [path.name for path in staging.episodes()] == ["a", "b-10", "b-2", "c"]
    assert staging.quarantined() == (odd,)
    assert odd.parent.name == "quarantine"
    assert load(odd)[0].reason == "two carrots"


def test_of_failed_attempts_the_info_alone_may_be_kept(tmp_path: Path) -> None:
    failed = made_info("a", label="failed", reason="it slipped")
    assert load(Staging(tmp_path / "all").commit(failed, made_recording()))[1] is not None
    sparing = Staging(tmp_path / "some", keep_failed=False)
    assert load(sparing.commit(failed, made_recording())) == (failed, None)
    assert load(sparing.commit(made_info("b"), made_recording()))[1] is not None
    assert load(sparing.commit(made_info("c", label="failed"), None))[1] is None, "of one that never moved"


def test_a_key_is_given_once(tmp_path: Path) -> None:
    staging = Staging(tmp_path)
    first = made_recording(seed=1)
    path = staging.commit(made_info("a"), first)
    for keep in (staging.commit, staging.quarantine):
        with pytest.raises(UsageError, match="There is an episode"):
            keep(made_info("a"), made_recording(seed=2))
    assert_same(first, load(path)[1])
    with pytest.raises(UsageError, match="that folder is taken"):
        staging.commit(made_info("quarantine"), first)


@pytest.mark.parametrize("camera", ["../main", "", ".main", "a/b", "a\0b"])
def test_a_camera_with_a_name_that_is_none_for_a_file_is_refused(tmp_path: Path, camera: str) -> None:
    recording = made_recording(T=2)
    with pytest.raises(UsageError, match="can't be kept"):
        Staging(tmp_path).commit(made_info("a"), Recording(recording.steps, {camera: recording.rgb["main"]}, {}))
    assert left_in(tmp_path) == set()


# What is broken -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["steps.npz", "episode.json", "rgb-main.npy"])
def test_damaged_files_are_said_to_be(tmp_path: Path, name: str) -> None:
    path = Staging(tmp_path).commit(made_info("a"), made_recording())
    whole = (path / name).read_bytes()
    for content in (b"", whole[: len(whole) // 2], b"\xff" * 200):
        (path / name).write_bytes(content)
        with pytest.raises(UsageError, match="holds no whole episode"):
            load(path)
    with pytest.raises(UsageError, match="holds no whole episode"):
        load(tmp_path / "b")


@pytest.mark.parametrize(
    ("number", "kind", "says"),
    [
        (errno.ENOSPC, SetupError, r"no room on the disk for an episode of 0 MB"),
        (errno.EDQUOT, SetupError, "no room"),
        (errno.EIO, SetupError, "disk fails"),
        (errno.EROFS, UsageError, "Read-only file system"),
        (errno.EACCES, UsageError, "Permission denied"),
    ],
)
@pytest.mark.parametrize("call", range(1, 6))
def test_a_disk_that_fails_anywhere_leaves_nothing_half_committed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, kind: type[ManiAgentError], says: str, call: int
) -> None:
    """The disk refuses at the first, second, ... file that is to be forced onto it: five before the renaming."""
    staging = Staging(tmp_path)
    before = staging.commit(made_info("before"), made_recording(T=2))
    calls = 0

    def fsync(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls == call:
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(kind, match=says):
        staging.commit(made_info("a"), made_recording(T=2))
    assert staging.episodes() == (before,)
    assert {path.name for path in tmp_path.iterdir()} == {"before", "quarantine"}
    calls = call
    staging.commit(made_info("a"), made_recording(T=2))
    assert len(staging.episodes()) == 2, "once there is room, the same episode can be committed"


def test_a_file_that_grows_too_large_is_told_as_a_full_disk(tmp_path: Path) -> None:
    """The system itself refuses to write on, in the middle of the pictures."""
    code = (
        "import resource, sys; from pathlib import Path\n"
        "from maniagent.data.staging import Staging; from maniagent.errors import SetupError\n"
        "from staged import made_info, made_recording\n"
        "staging = Staging(Path(sys.argv[1])); recording = made_recording(T=60)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))\n"
        "try: staging.commit(made_info('a'), recording)\n"
        "except SetupError as error: print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        capture_output=True, text=True, check=True, cwd=HERE,
    )  # fmt: skip
    assert "There is no room on the disk" in done.stdout
    assert left_in(tmp_path) == set()
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 200_000


def test_a_folder_that_cant_be_made_or_written_to_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="Not a directory"):
        Staging(tmp_path / "file")
    if os.geteuid() == 0:
        return  # to root nothing is read-only
    (tmp_path / "locked" / "quarantine").mkdir(parents=True)
    (tmp_path / "locked").chmod(0o555)
    with pytest.raises(UsageError, match="can't be written to"):
        Staging(tmp_path / "locked")


# Killed -------------------------------------------------------------------------------------------------------------

WRITES_ON = (
    "import sys; from pathlib import Path\n"
    "from maniagent.data.staging import Staging\n"
    "from staged import made_info, made_recording\n"
    "staging = Staging(Path(sys.argv[1])); recordings = [made_recording(T=40, seed=k) for k in range(5)]\n"
    "print('ready', flush=True)\n"
    "for n in range(100_000):\n"
    "    (staging.quarantine if n % 4 == 3 else staging.commit)(made_info(f'e{n}', seed=n), recordings[n % 5])\n"
    "    print(n, flush=True)\n"
)


def killed_after(seconds: float, folder: Path) -> list[int]:
    """Start a process that commits without end, kill it; the numbers of the episodes that it said were committed."""
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITES_ON, str(folder)],
        stdout=subprocess.PIPE, text=True, cwd=HERE,
    )  # fmt: skip
    assert writer.stdout is not None
    assert writer.stdout.readline() == "ready\n"
    time.sleep(seconds)
    writer.send_signal(signal.SIGKILL)
    said = writer.stdout.read().splitlines(keepends=True)
    writer.wait()
    return [int(line) for line in said if line.endswith("\n")]


@pytest.mark.slow
def test_whoever_is_killed_leaves_whole_episodes_and_what_can_be_swept(tmp_path: Path) -> None:
    moments = random.Random(0)  # noqa: S311 - no secret
    expected = [made_recording(T=40, seed=k) for k in range(5)]
    swept = 0
    for kill in range(20):
        folder = tmp_path / str(kill)
        said = killed_after(moments.uniform(0.0, 0.05), folder)
        staging = Staging(folder)
        swept += staging.sweep()
        found: dict[str, EpisodeInfo] = {}
        for path in (*staging.episodes(), *staging.quarantined()):
            info, recording = load(path)
            assert_same(expected[info.seed % 5], recording)
            found[path.name] = info
        assert {f"e{n}" for n in said} <= set(found), "what was said to be committed is there"
        assert len(found) <= len(said) + 1
        assert not list(folder.rglob(".*"))
    assert swept > 0, "some were killed in the middle of an episode"


def test_sweeping_removes_drafts_and_nothing_else(tmp_path: Path) -> None:
    staging = Staging(tmp_path)
    kept = staging.commit(made_info("a"), made_recording(T=2))
    for place in (tmp_path, tmp_path / "quarantine"):
        (place / ".b.part").mkdir()
        (place / ".b.part" / "steps.npz").write_bytes(b"half")
    (tmp_path / ".git").mkdir()
    assert staging.sweep() == 2
    assert staging.sweep() == 0
    assert staging.episodes() == (kept,)
    assert (tmp_path / ".git").exists()


def test_a_draft_that_was_left_is_written_anew(tmp_path: Path) -> None:
    staging = Staging(tmp_path)
    (tmp_path / ".a.part").mkdir()
    (tmp_path / ".a.part" / "rgb-old.npy").write_bytes(b"half")
    _, recording = load(staging.commit(made_info("a"), made_recording()))
    assert recording is not None
    assert set(recording.rgb) == {"main", "side"}
