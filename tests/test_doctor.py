import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from maniagent import doctor
from maniagent.cli import app
from maniagent.doctor import Check


@pytest.fixture(scope="module")
def checks() -> tuple[Check, ...]:
    return doctor.examine()


def test_this_machine_is_fit(checks: tuple[Check, ...]) -> None:
    assert doctor.works(checks), [check for check in checks if check.needed and not check.ok]


def test_all_that_matters_is_looked_at(checks: tuple[Check, ...]) -> None:
    names = {check.name for check in checks}
    assert names >= {
        "Python",
        "simulation",
        "inverse kinematics",
        "motion planning",
        "motion timing",
        "video encoder",
        "rendering, egl",
        "rendering, osmesa",
        "run folder",
        "screen",
        "processors",
        "extra, dev",
    }


def test_whatever_is_missing_comes_with_its_fix(checks: tuple[Check, ...]) -> None:
    assert all(check.fix for check in checks if not check.ok)
    assert not any(check.fix for check in checks if check.ok)


@pytest.mark.parametrize(
    "error", [ImportError("no solver"), OSError("libx264"), RuntimeError("missed"), ValueError("x")]
)
def test_a_library_that_does_not_work_is_found_out(error: Exception) -> None:
    def trial() -> None:
        raise error

    check = doctor._tried("timing", "ruckig", trial)
    assert (check.ok, check.needed) == (False, True)
    assert str(error) in check.detail
    assert "pip install" in check.fix


def test_a_package_that_is_not_installed_is_found_out() -> None:
    check = doctor._tried("flying", "maniagent-has-no-wings", lambda: None)
    assert not check.ok
    assert check.fix.endswith("pip install maniagent-has-no-wings")


@pytest.mark.parametrize(
    ("reasons", "fit"),
    [
        ({"egl": "", "osmesa": ""}, True),
        ({"egl": "no library", "osmesa": ""}, True),
        ({"egl": "no library", "osmesa": "no library"}, False),
    ],
)
def test_one_back_end_that_draws_is_enough(reasons: dict[str, str], fit: bool) -> None:
    checks = doctor._renderers(reasons)
    assert doctor.works(checks) is fit
    assert all("apt-get install" in check.fix for check in checks if not check.ok)


def test_a_folder_that_cannot_be_written_is_found_out(tmp_path: Path) -> None:
    assert doctor._writable(tmp_path).ok
    assert not doctor._writable(tmp_path / "missing").ok


def test_extras_are_looked_up_by_what_they_require() -> None:
    requirements = ['pytest>=8; extra == "dev"', 'no-such-thing[x]>=1; extra == "models"', "numpy>=2"]
    assert doctor._extra("dev", requirements).ok
    missing = doctor._extra("models", requirements)
    assert (missing.ok, missing.needed) == (False, False)
    assert "no-such-thing" in missing.detail
    assert "'maniagent[models]'" in missing.fix


@pytest.mark.parametrize("fit", [True, False])
def test_the_command_says_so_by_its_exit_status(monkeypatch: pytest.MonkeyPatch, fit: bool) -> None:
    found = (
        Check("rendering", fit, "none", "" if fit else "apt-get install [it]"),
        Check("screen", False, "-", "x", False),
    )
    monkeypatch.setattr(doctor, "examine", lambda: found)
    text = CliRunner().invoke(app, ["doctor"])
    printed = CliRunner().invoke(app, ["doctor", "--json"])
    assert text.exit_code == printed.exit_code == (0 if fit else 2)
    assert json.loads(printed.stdout)["works"] is fit
    assert ("needed: rendering: apt-get install [it]" in text.stdout) is not fit
