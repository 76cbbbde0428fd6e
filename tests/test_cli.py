"""The command line against the real commands, and `run` against an app that answers as it is told."""

import json
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from maniagent import __version__, tasks
from maniagent.cli import app
from maniagent.errors import SetupError
from maniagent.types import ExecutionReport, RunResult, RunVerdict, SubtaskRecord, Verdict


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def outcome(verdict: RunVerdict, achieved: bool | None) -> types.SimpleNamespace:
    record = SubtaskRecord("put [it] there", (), ExecutionReport(True, 6), Verdict.SUCCESS, "it is there", ("it",))
    result = RunResult("put [it] there", verdict, "All is done.", (record,), {"observe": 0.51, "execution": 7.0})
    return types.SimpleNamespace(
        task="carrot-on-plate",
        seed=3,
        instruction="put [it] there",
        result=result,
        achieved=achieved,
        out=Path("runs/x"),
    )


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], list[dict[str, Any]]]:
    """Let `maniagent.app.run` return or raise something; gives back the list of calls it gets."""

    def set_answer(value: Any) -> list[dict[str, Any]]:
        calls: list[dict[str, Any]] = []

        def run(instruction: str | None, **options: Any) -> Any:
            calls.append({"instruction": instruction, **options})
            if isinstance(value, BaseException):
                raise value
            return value

        module = types.ModuleType("maniagent.app")
        module.run = run  # type: ignore[attr-defined] # a module made here
        monkeypatch.setitem(sys.modules, "maniagent.app", module)
        return calls

    return set_answer


@pytest.mark.parametrize(
    ("verdict", "achieved", "status"),
    [
        (RunVerdict.ACHIEVED, True, 0),
        (RunVerdict.ACHIEVED, False, 1),
        (RunVerdict.CANNOT, True, 0),
        (RunVerdict.ACHIEVED, None, 0),
        (RunVerdict.CANNOT, None, 1),
        (RunVerdict.OUT_OF_BUDGET, False, 1),
        (RunVerdict.ABORTED, None, 1),
    ],
)
@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_the_truth_decides_and_else_what_the_agents_believe(
    answer: Callable[[Any], Any], verdict: RunVerdict, achieved: bool | None, status: int, flags: tuple[str, ...]
) -> None:
    answer(outcome(verdict, achieved))
    assert call("run", "--task", "carrot-on-plate", *flags).exit_code == status


def test_json_is_one_object_and_nothing_else(answer: Callable[[Any], Any]) -> None:
    answer(outcome(RunVerdict.ACHIEVED, None))
    printed = json.loads(call("run", "--task", "carrot-on-plate", "--json").stdout)
    assert list(printed) == [
        "task", "seed", "instruction", "verdict", "achieved", "reason", "subtasks", "seconds", "out",
    ]  # fmt: skip
    assert printed["achieved"] is None
    assert printed["seconds"] == {"observe": 0.51, "execution": 7.0}


def test_a_person_reads_belief_truth_and_where_the_report_is(answer: Callable[[Any], Any]) -> None:
    answer(outcome(RunVerdict.ACHIEVED, False))
    text = call("run", "--task", "carrot-on-plate").stdout
    assert "achieved  All is done." in text
    assert "in truth not achieved  (the agents believe otherwise)" in text
    assert "runs/x/report.html" in text


def test_options_arrive_at_the_app(answer: Callable[[Any], Any], tmp_path: Path) -> None:
    calls = answer(outcome(RunVerdict.ACHIEVED, True))
    call("run", "do it", "--scene", "kitchen.yaml", "--seed", "7", "--out", str(tmp_path), "--view")
    (given,) = calls
    assert (given["instruction"], given["task"], given["scene"]) == ("do it", None, Path("kitchen.yaml"))
    assert (given["seed"], given["out"], given["view"]) == (7, tmp_path, True)


def test_without_out_the_folder_is_named_after_the_task_and_seed(answer: Callable[[Any], Any]) -> None:
    calls = answer(outcome(RunVerdict.ACHIEVED, True))
    call("run", "--task", "carrot-on-plate", "--seed", "5")
    assert calls[0]["out"].parent == Path("runs")
    assert calls[0]["out"].name.endswith("-carrot-on-plate-s5")


def test_an_error_is_one_line_and_status_2(answer: Callable[[Any], Any]) -> None:
    answer(SetupError("Nothing draws. Install [it]."))
    result = call("run", "--task", "carrot-on-plate")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.strip() == "error: Nothing draws. Install [it]."


def test_an_error_under_json_is_an_object_too(answer: Callable[[Any], Any]) -> None:
    answer(SetupError("Nothing draws."))
    result = call("run", "--task", "carrot-on-plate", "--json")
    assert result.exit_code == 2
    assert json.loads(result.stdout) == {"error": "Nothing draws."}


def test_ctrl_c_is_a_clear_line_and_130(answer: Callable[[Any], Any]) -> None:
    answer(KeyboardInterrupt())
    result = call("run", "--task", "carrot-on-plate")
    assert result.exit_code == 130
    assert "Ctrl-C" in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("run",),
        ("run", "--task", "a", "--scene", "b.yaml"),
        ("run", "--task", "a", "--seed", "-1"),
        ("run", "--task", "a", "--nonsense"),
        ("fly",),
        ("report", "no/such/folder"),
    ],
)
def test_wrong_use_is_status_2_without_a_traceback(arguments: tuple[str, ...]) -> None:
    result = call(*arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert result.stderr


def test_tasks_lists_every_task() -> None:
    text = call("tasks").stdout
    listed = json.loads(call("tasks", "--json").stdout)
    assert [task["name"] for task in listed] == list(tasks.names())
    assert set(listed[0]) == {"name", "title", "instruction", "suite", "needs_model"}
    assert all(name in text for name in tasks.names())


def test_help_teaches_by_example() -> None:
    text = call("run", "--help").stdout
    assert "maniagent run --task carrot-on-plate" in text
    assert "Exit status" in text


def test_version() -> None:
    assert call("--version").stdout.strip() == f"maniagent {__version__}"


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from maniagent.cli import app\n"
        "assert CliRunner().invoke(app, ['--help']).exit_code == 0\n"
        "print([name for name in ('mujoco', 'numpy', 'cv2', 'pydantic', 'scipy', 'ompl') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_installed_command_runs() -> None:
    done = subprocess.run([sys.executable, "-m", "maniagent.cli", "tasks", "--json"], capture_output=True, check=True)
    assert json.loads(done.stdout)
