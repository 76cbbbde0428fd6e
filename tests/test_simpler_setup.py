"""What `maniagent simpler setup` says where things are missing; nothing is downloaded here."""

from pathlib import Path

import pytest

from maniagent import simpler_setup
from maniagent.envs.simpler import assets
from maniagent.errors import SetupError


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simpler_setup, "missing_packages", lambda: ())


def complete(root: Path) -> Path:
    for pattern in assets._PATTERNS:
        path = root / "data" / pattern.replace("*", "x")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return root


def test_files_are_missing_until_they_are_all_there(tmp_path: Path) -> None:
    assert len(assets.missing_files(tmp_path)) == len(assets._PATTERNS)
    complete(tmp_path)
    assert assets.missing_files(tmp_path) == ()
    (tmp_path / "data/robots/widowx/wx250s.srdf").unlink()
    assert assets.missing_files(tmp_path) == ("robots/widowx/wx250s.srdf",)


def test_the_asset_folder_is_maniskills(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MS_ASSET_DIR", "/somewhere")
    assert assets.asset_root() == Path("/somewhere")
    monkeypatch.delenv("MS_ASSET_DIR")
    assert assets.asset_root() == Path.home() / ".maniskill"


def test_without_packages_nothing_else_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simpler_setup, "missing_packages", lambda: ("torch",))
    (check,) = simpler_setup.examine(tmp_path)
    assert (check.ok, check.fix) == (False, "pip install 'maniagent[simpler]'")


@pytest.mark.usefixtures("installed")
def test_missing_assets_are_told_with_their_folder(tmp_path: Path) -> None:
    *_, check = simpler_setup.examine(tmp_path, download=False)
    assert not check.ok
    assert str(tmp_path / "data") in check.detail
    assert check.fix == f"maniagent simpler setup --assets {tmp_path}"


@pytest.mark.usefixtures("installed")
def test_what_is_there_in_part_is_never_deleted_for_a_download(tmp_path: Path) -> None:
    complete(tmp_path)
    kept = tmp_path / "data/robots/widowx/wx250s.urdf"
    (tmp_path / "data/robots/widowx/wx250s.srdf").unlink()
    with pytest.raises(SetupError, match="not complete"):
        simpler_setup.examine(tmp_path)
    assert kept.exists()


@pytest.mark.usefixtures("installed")
def test_a_download_that_fails_says_why_and_what_else_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simpler_setup, "_DOWNLOADER", "maniagent.no_such_module")
    with pytest.raises(SetupError, match=r"could not download 'bridge_v2_real2sim'.*--assets"):
        simpler_setup.examine(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_assets_that_are_no_assets_fail_in_the_trial_alone(tmp_path: Path) -> None:
    told = simpler_setup.examine(complete(tmp_path))
    assert [check.ok for check in told] == [True, True, False]
    assert told[-1].fix
