"""SimplerEnv's evaluation: two real episodes of each task, and what is said where they can't be played."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from maniagent.cli import app
from maniagent.envs.simpler import TASKS
from maniagent.envs.simpler.assets import missing_packages
from maniagent.errors import SetupError, UsageError
from maniagent.evaluation import suites
from maniagent.evaluation.episode import FINAL_PICTURE, MOST_EPISODES, Job
from maniagent.evaluation.poses import OFF_GRID, Poses
from maniagent.evaluation.runner import evaluate
from simplerenv import skip_without

CRITERIA = {"any", "strict", "at 120", "any at 120", "strict at 120"}


@pytest.mark.slow
def test_the_rules_solve_two_episodes_of_each_task(tmp_path: Path) -> None:
    skip_without()
    try:
        summary = evaluate("simpler", out=tmp_path, episodes=2, seeds=1, workers=1, record=False)
    except SetupError as error:
        pytest.skip(str(error))
    assert summary.finished == 8
    results = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert {result["stage"] for result in results} & {"crash", "time-limit"} == set()
    for result in results:
        assert set(result["criteria"]) == CRITERIA
        assert result["success"], result
        assert result["criteria"]["strict"], result
        assert result["believed"], result
        assert 0 < result["steps"] <= 60
        assert sum(result["seconds"].values()) == pytest.approx(result["wall_seconds"], abs=0.05)
    assert {row.task for row in summary.rows} == set(TASKS)
    assert summary.average is not None
    assert summary.average.shares["simulator"] > 0


@pytest.mark.slow
def test_an_episode_off_the_grid_is_recorded_and_can_be_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    skip_without()
    monkeypatch.chdir(tmp_path)
    command = ["simpler", "play", "simpler-carrot", "--episode", "31", "--poses", OFF_GRID, "--pose-seed", "5"]
    first, second = (CliRunner().invoke(app, [*command, "--json"]) for _ in range(2))
    if "doesn't render here" in first.stdout:
        pytest.skip(json.loads(first.stdout)["error"])
    assert first.exit_code in (0, 1), first.output
    told, again = json.loads(first.stdout), json.loads(second.stdout)
    assert {key: told[key] for key in ("success", "criteria", "steps", "reason")} == {
        key: again[key] for key in ("success", "criteria", "steps", "reason")
    }
    folder = tmp_path / "runs" / "simpler-carrot-e031"
    for name in ("video.mp4", "report.html", "events.jsonl", FINAL_PICTURE):
        assert (folder / name).stat().st_size > 0, name


def test_without_the_extra_or_the_assets_it_ends_at_once_with_the_line_that_mends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MS_ASSET_DIR", str(tmp_path / "none"))
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["eval", "simpler", "--out", str(out), "--json"])
    assert done.exit_code == 2
    fix = "pip install 'maniagent[simpler]'" if missing_packages() else "maniagent simpler setup --assets"
    assert fix in json.loads(done.stdout)["error"]
    assert not out.exists()


def test_poses_are_for_suites_that_leave_them_to_choose() -> None:
    with pytest.raises(UsageError, match="draws its scenes from the seed"):
        suites.placed(suites.get("tabletop"), Poses(OFF_GRID, 1))


def test_the_grid_has_24_layouts_and_more_lie_off_it(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"24 or less.*--poses off-grid"):
        evaluate("simpler", out=tmp_path / "new", episodes=25)
    assert suites.placed(suites.get("simpler"), Poses(OFF_GRID)).episodes == MOST_EPISODES


def test_the_command_that_repeats_an_episode_names_its_poses() -> None:
    placed = suites.placed(suites.get("simpler-spoon"), Poses(OFF_GRID, 5))
    again = placed.repeat(Job("simpler-spoon", 0, 31), "rules")
    assert again == "maniagent simpler play simpler-spoon --episode 31 --poses off-grid --pose-seed 5"
    assert suites.get("simpler").repeat(Job("simpler-stack", 2, 7), "rules").endswith("simpler-stack --episode 7")


def test_an_unknown_task_suggests_the_nearest() -> None:
    done = CliRunner().invoke(app, ["simpler", "play", "simpler-carot", "--json"])
    assert done.exit_code == 2
    assert "Did you mean 'simpler-carrot'" in json.loads(done.stdout)["error"]


@pytest.mark.slow
def test_set_up_that_is_complete_is_tried_out() -> None:
    skip_without()
    done = CliRunner().invoke(app, ["simpler", "setup", "--no-download", "--json"])
    told = json.loads(done.stdout)
    assert [check["name"] for check in told["checks"]] == ["packages", "assets", "trial"]
    assert told["works"] is (done.exit_code == 0)
