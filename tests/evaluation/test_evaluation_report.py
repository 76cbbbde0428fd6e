"""The page, the tables and the files of an evaluation say what happened, whatever words it comes in."""

import csv
import json
from pathlib import Path

import fakes
import numpy as np
import pytest
from PIL import Image

from maniagent.evaluation import report, tables
from maniagent.evaluation.episode import FINAL_PICTURE, EpisodeResult, Job, lost
from maniagent.evaluation.published import published
from maniagent.evaluation.results import Settings
from maniagent.evaluation.summary import Summary, summarise
from pages import Reader

HOSTILE = '</title><script>alert(1)</script><img src=x onerror="alert(2)">\x00 | `a` " \' & {braces}'


def run_folder(out: Path, job: Job) -> str:
    """A run folder as a recorder leaves it, as far as an evaluation looks into it."""
    folder = out / "episodes" / job.name
    (folder / "observations").mkdir(parents=True)
    Image.fromarray(np.full((480, 640, 3), 90, np.uint8)).save(folder / "observations" / "turn-01-main.png")
    files = {"main": "observations/turn-01-main.png"}
    event = {"kind": "observed", "time": 1.0, "turn": 1, "observation": {"main": "main"}, "files": files}
    (folder / "events.jsonl").write_text(json.dumps(event) + "\n")
    (folder / "report.html").write_text("")
    return f"episodes/{job.name}"


def summary(out: Path, *results: EpisodeResult, tasks: tuple[str, ...] = ("win", "lose")) -> Summary:
    settings = Settings(
        suite="fake", tasks=tasks, actor="rules", episodes=2, seeds=1, time_limit=300.0, version="1"
    )  # fmt: skip
    return summarise(fakes.suite(*tasks), settings, out, results, 4, published())


def results(out: Path) -> list[EpisodeResult]:
    shown = lost(Job("lose", 0, 0), "crash", HOSTILE)
    return [
        fakes.run_episode("win", 0, 0, "rules", None),
        fakes.run_episode("win", 0, 1, "rules", None),
        shown.model_copy(update={"folder": run_folder(out, shown.job)}),
        fakes.run_episode("lose", 0, 1, "rules", None),
    ]


@pytest.fixture
def reader(tmp_path: Path) -> Reader:
    return Reader(report.render(summary(tmp_path, *results(tmp_path))))


def test_the_page_tells_rates_intervals_failures_and_how_to_repeat_them(reader: Reader) -> None:
    told = ("50.0 %", "15.0–85.0", "strict", "unnoticed", "I see <b>it</b> | there", "play lose-s0-e001 --with rules")
    for words in (*told, "4 of 4", "ManiAgent, GPT-5"):
        assert words in reader.text, words


def test_a_failed_episode_shows_its_last_view_and_leads_to_its_report(reader: Reader) -> None:
    (image,) = reader.all("img")
    assert (image["width"], image["height"], image["alt"]) == ("320", "240", "Last view of lose-s0-e000")
    assert str(image["src"]).startswith("data:image/jpeg;base64,")
    assert "episodes/lose-s0-e000/report.html" in [link["href"] for link in reader.all("a")]


def test_the_picture_of_the_end_comes_before_the_last_look(tmp_path: Path) -> None:
    failed = lost(Job("lose", 0, 0), "grasp", "it slipped")
    folder = run_folder(tmp_path, failed.job)
    Image.fromarray(np.full((90, 160, 3), 200, np.uint8)).save(tmp_path / folder / FINAL_PICTURE)
    page = Reader(report.render(summary(tmp_path, failed.model_copy(update={"folder": folder}))))
    (image,) = page.all("img")
    assert (image["width"], image["height"]) == ("160", "90")


def test_wall_time_is_told_by_what_it_went_into(tmp_path: Path) -> None:
    timed = EpisodeResult(
        task="win", seed=0, episode=0, success=True, wall_seconds=4.0, seconds={"simulator": 3.0, "other": 1.0}
    )  # fmt: skip
    told = summary(tmp_path, timed)
    assert "Wall time" in Reader(report.render(told)).text
    assert "| win | 15 | 75.0 | 25.0 |" in tables.markdown(told)
    assert told.to_plain()["average"]["shares"] == {"simulator": 0.75, "other": 0.25}
    assert not tables.time_table(summary(tmp_path)).rows


def test_nothing_that_was_said_becomes_markup_and_nothing_is_fetched(reader: Reader) -> None:
    assert len(reader.all("script")) == 1
    assert HOSTILE.replace("\x00", "") in " ".join(reader.words)
    assert not any("onerror" in attributes for _, attributes in reader.elements)
    assert not reader.all("link")
    (policy,) = [meta["content"] for meta in reader.all("meta") if meta.get("http-equiv")]
    assert str(policy).startswith("default-src 'none'")


def test_an_episode_whose_folder_is_broken_or_gone_is_listed_all_the_same(tmp_path: Path) -> None:
    gone, cut = (lost(Job("lose", 0, k), "crash", "died") for k in (0, 1))
    folder = run_folder(tmp_path, cut.job)
    (tmp_path / folder / "observations" / "turn-01-main.png").write_bytes(b"\x89PNG")
    told = summary(
        tmp_path,
        gone.model_copy(update={"folder": "episodes/gone"}),
        cut.model_copy(update={"folder": folder}),
    )
    page = Reader(report.render(told))
    assert "lose-s0-e000" in page.text
    assert "Last view of lose-s0-e001 : no picture" in page.text.replace(":", " :").replace("  ", " ")


def test_an_evaluation_without_any_episode_can_be_told(tmp_path: Path) -> None:
    nothing = summary(tmp_path)
    assert "No episode is finished" in Reader(report.render(nothing)).text
    assert "0 of 4 episodes" in tables.markdown(nothing)
    assert json.loads(json.dumps(nothing.to_plain(), allow_nan=False))["complete"] is False


def test_markdown_tables_keep_their_columns(tmp_path: Path) -> None:
    lines = tables.markdown(summary(tmp_path, *results(tmp_path))).splitlines()
    rows = [line.replace("\\|", "") for line in lines if line.startswith("|")]
    starts = [i for i, line in enumerate(rows) if set(line) <= set("|- ")]
    for start, end in zip(starts, [*(i - 1 for i in starts[1:]), len(rows)], strict=True):
        assert len({row.count("|") for row in rows[start - 1 : end]}) == 1
    assert "<script" not in "\n".join(lines)


def test_columns_appear_where_episodes_have_them(tmp_path: Path) -> None:
    plain = EpisodeResult(task="win", seed=0, episode=0, success=True)
    measured = plain.model_copy(update={"criteria": {"strict": False}, "steps": 31, "tokens": 1200})
    bare, full = (tables.result_table(summary(tmp_path, result)).head for result in (plain, measured))
    assert set(full) - set(bare) == {"strict %", "steps", "tokens"}


def test_the_spreadsheet_has_a_line_for_every_episode(tmp_path: Path) -> None:
    rows = list(csv.DictReader(tables.episodes_csv(results(tmp_path)).splitlines()))
    assert [(row["task"], row["episode"], row["success"]) for row in rows] == [
        ("lose", "0", "False"), ("lose", "1", "False"), ("win", "0", "True"), ("win", "1", "True"),
    ]  # fmt: skip
    assert json.loads(rows[1]["failed_turns"]) == {"grasp": 2}


def test_published_figures_name_a_source_or_say_that_none_was_looked_at() -> None:
    for figure in published():
        assert figure.source.startswith("https://") or "not looked at" in figure.caveat
