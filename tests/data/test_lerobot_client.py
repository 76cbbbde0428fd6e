"""The writer's client, against scripts that answer as a writer might; no lerobot is needed."""

from __future__ import annotations

import os
import signal
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from maniagent.data.lerobot.client import Writer, WriterFailure
from maniagent.data.lerobot.interpreter import VARIABLE, find_interpreter
from maniagent.errors import SetupError

READY = 'import sys, json, time, os\nprint(json.dumps({"ok": {}}), flush=True)\n'


def fake(folder: Path, body: str, **limits: float) -> Writer:
    """A writer whose script is `body`, run by this Python."""
    script = folder / "fake.py"
    script.write_text(textwrap.dedent(body))
    return Writer(Path(sys.executable), script=script, **limits)


def ask(writer: Writer) -> None:
    writer.merge([Path("a"), Path("b")], Path("c"))


def test_a_process_serves_many_requests(tmp_path: Path) -> None:
    body = READY + 'for line in sys.stdin: open("asked", "a").write(line); print(json.dumps({"ok": {}}), flush=True)'
    with fake(tmp_path, f'import os; os.chdir("{tmp_path}")\n' + body) as writer:
        for _ in range(3):
            ask(writer)
    assert (tmp_path / "asked").read_text().count('"do": "merge"') == 3


def test_a_writer_that_dies_is_told_with_its_last_words(tmp_path: Path) -> None:
    body = READY + 'sys.stdin.readline(); print("no more video", file=sys.stderr); sys.exit(3)'
    with fake(tmp_path, body) as writer, pytest.raises(WriterFailure, match=r"status 3.*no more video"):
        ask(writer)


def test_a_writer_that_is_killed_is_told(tmp_path: Path) -> None:
    body = READY + "sys.stdin.readline(); os.kill(os.getpid(), 9)"
    with fake(tmp_path, body) as writer, pytest.raises(WriterFailure, match="signal 9"):
        ask(writer)


def test_after_a_death_the_next_request_starts_another(tmp_path: Path) -> None:
    mark = tmp_path / "died"
    body = (
        READY
        + f'''
sys.stdin.readline()
if not os.path.exists("{mark}"):
    open("{mark}", "w").close()
    sys.exit(1)
print(json.dumps({{"ok": {{}}}}), flush=True)
'''
    )
    with fake(tmp_path, body) as writer:
        with pytest.raises(WriterFailure):
            ask(writer)
        ask(writer)


def test_a_writer_that_does_not_answer_is_ended(tmp_path: Path) -> None:
    body = READY + f'open("{tmp_path}/pid", "w").write(str(os.getpid())); sys.stdin.readline(); time.sleep(60)'
    began = time.monotonic()
    with fake(tmp_path, body, limit=0.5) as writer, pytest.raises(WriterFailure, match=r"more than 0\.5 s to merge"):
        ask(writer)
    assert time.monotonic() - began < 10
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), signal.SIG_DFL)


def test_a_writer_that_does_not_start_is_ended(tmp_path: Path) -> None:
    body = "import time; time.sleep(60)"
    with fake(tmp_path, body, start_limit=0.3) as writer, pytest.raises(WriterFailure, match="to start"):
        ask(writer)


def test_a_request_can_be_interrupted_by_another_thread(tmp_path: Path) -> None:
    asked = tmp_path / "asked"
    body = READY + f'sys.stdin.readline(); open("{asked}", "w").close(); time.sleep(60)'
    with fake(tmp_path, body) as writer, ThreadPoolExecutor() as threads:
        asking = threads.submit(ask, writer)
        while not asked.exists():
            time.sleep(0.01)
        writer.interrupt()
        with pytest.raises(WriterFailure, match="signal 9"):
            asking.result(timeout=10)


def test_interrupting_nothing_does_no_harm(tmp_path: Path) -> None:
    with fake(tmp_path, READY) as writer:
        writer.interrupt()


def test_an_interpreter_without_lerobot_is_found_without_starting_the_writer(tmp_path: Path) -> None:
    python = tmp_path / "python"
    for script, told in (("#!/bin/sh\nexit 1\n", "has no lerobot"), ("#!/nowhere\n", "doesn't start")):
        python.write_text(script)
        python.chmod(0o755)
        with pytest.raises(SetupError, match=told):
            Writer(python).check()


def test_an_interpreter_without_lerobot_is_told_with_what_to_do(tmp_path: Path) -> None:
    body = "import lerobot_that_is_not_there"
    with fake(tmp_path, body) as writer, pytest.raises(SetupError, match=r"has no lerobot.*pip install"):
        ask(writer)


@pytest.mark.parametrize(
    ("answer", "error", "told"),
    [
        ('{"kind": "OSError", "message": "x", "errno": 28}', SetupError, "full"),
        ('{"kind": "RuntimeError", "message": "thread: No space left on device", "errno": null}', SetupError, "full"),
        ('{"kind": "OSError", "message": "x", "errno": 30}', SetupError, "can't be written"),
        ('{"kind": "ValueError", "message": "odd shape", "errno": null}', WriterFailure, "ValueError: odd shape"),
    ],
)  # fmt: skip
def test_a_refusal_says_what_to_do(tmp_path: Path, answer: str, error: type[Exception], told: str) -> None:
    body = READY + f"sys.stdin.readline(); print('{{\"error\": {answer}}}', flush=True)"
    with fake(tmp_path, body) as writer, pytest.raises(error, match=told):
        ask(writer)


def test_long_answers_and_several_in_one_read_are_kept_apart(tmp_path: Path) -> None:
    second = '{"error": {"kind": "E", "message": "2nd", "errno": null}}'
    body = (
        READY
        + f"""
sys.stdin.readline()
for piece in ['{{"ok": {{"x": "', "y" * 200000, '"}}}}' + chr(10) + '{second}' + chr(10)]:
    sys.stdout.write(piece)
    sys.stdout.flush()
time.sleep(60)
"""
    )
    with fake(tmp_path, body) as writer:
        ask(writer)
        with pytest.raises(WriterFailure, match="2nd"):
            ask(writer)


def test_nothing_of_ours_leaks_into_another_interpreter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "ours")
    link = tmp_path / "python"
    link.symlink_to(sys.executable)
    script = tmp_path / "fake.py"
    script.write_text(READY + f'open("{tmp_path}/env", "w").write(json.dumps(dict(os.environ)))\n' + "sys.stdin.read()")
    with Writer(link, script=script, limit=1.0) as writer, pytest.raises(WriterFailure):
        ask(writer)
    told = (tmp_path / "env").read_text()
    assert '"PYTHONPATH"' not in told
    assert '"HF_HUB_OFFLINE": "1"' in told


def test_the_interpreter_is_the_one_named_then_the_variable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    named, other = tmp_path / "named", tmp_path / "other"
    for path in (named, other):
        path.symlink_to(sys.executable)
    monkeypatch.setenv(VARIABLE, str(other))
    assert find_interpreter(named) == named
    assert find_interpreter() == other


def test_an_interpreter_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SetupError, match="no Python interpreter"):
        find_interpreter(tmp_path / "nowhere")


def test_without_lerobot_anywhere_it_says_where_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(SetupError, match=VARIABLE):
        find_interpreter()
