"""Does a collection survive being killed? The whole command is killed at random moments, and goes on each time.

    python benchmarks/endurance/collecting_killed.py --kills 20 -n 24 --workers 2 --out DIR --lerobot-python PYTHON

Each round starts `maniagent collect` as it left off and kills its whole process group (workers and the dataset's writer
too) with SIGKILL at a moment drawn uniformly from [0, --seconds]: in its start, while it collects, while it publishes.
All that was seen to be committed, at any time before, must still be there, whole and unchanged: among the staged
episodes, or once in the dataset. The dataset must pass `maniagent data verify`. Where a round finishes before its
moment, -n more episodes are wanted and it doesn't count. In the end the collection finishes, every picture is decoded,
and lerobot reads it. Writes DIR/killed.json and DIR/killed.md; the exit status is 1 where anything was lost.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from rich.console import Console
from rich.table import Table

from maniagent.data.lerobot.ledger import read_ledger
from maniagent.data.lerobot.publish import DATASET, STAGED
from maniagent.data.lerobot.writer import read_columns

NUMBERS = ("observation.state", "observation.ee_pose", "action", "ee_delta")
OPEN = """
import sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
data = LeRobotDataset("maniagent/dataset", root=sys.argv[1], video_backend="pyav")
[data[index] for index in (0, len(data) // 2, len(data) - 1)]
print(data.num_episodes)
"""
LOOKS = 0.1
"""s between looks at what is committed."""
GONE = 10.0
"""s within which no process of a killed group may be left."""


@dataclass
class Round:
    """One start of the command, and what was found after its end."""

    number: int
    killed_after: float | None
    """s; None where it finished by itself."""
    phase: str
    staged: int = 0
    published: int = 0
    committed: int = 0
    """Episodes ever seen to be committed."""
    problems: list[str] = field(default_factory=list)


class Watch:
    """Remembers the contents of every episode that was ever seen to be committed, and looks for them again."""

    def __init__(self, collection: Path) -> None:
        self._staged, self._dataset = collection / STAGED, collection / DATASET
        self._files: dict[str, str] = {}
        """By key: a hash of all of a staged episode's files."""
        self._numbers: dict[str, str] = {}
        """By key: a hash of its numbers, which is the same in the dataset."""

    @property
    def keys(self) -> set[str]:
        """All that was ever seen."""
        return set(self._numbers)

    def look(self) -> None:
        """Take note of staged episodes that are new; one may go into the dataset under our eyes."""
        for info in sorted(self._staged.glob("w*/episode.json")):
            key = info.parent.name
            if key not in self._files:
                try:
                    files, numbers = hash_files(info.parent), hash_columns(read_columns(info.parent))
                except FileNotFoundError:
                    continue
                self._files[key] = files
                self._numbers.setdefault(key, numbers)

    def check(self) -> tuple[int, int, list[str]]:
        """How many are staged, how many are in the dataset, and what isn't as it was. No process may run."""
        problems = []
        staged = {info.parent.name: info.parent for info in self._staged.glob("w*/episode.json")}
        published = dict(published_numbers(self._dataset))
        for key, folder in staged.items():
            if self._files.setdefault(key, hash_files(folder)) != hash_files(folder):
                problems.append(f"{key} has changed where it is staged")
            self._numbers.setdefault(key, hash_columns(read_columns(folder)))
        for key, numbers in published.items():
            if self._numbers.setdefault(key, numbers) != numbers:
                problems.append(f"{key} has changed in the dataset")
        problems += [f"{key} is lost" for key in sorted(self.keys - staged.keys() - published.keys())]
        return len(staged), len(published), problems


def hash_files(folder: Path) -> str:
    """Of names and contents."""
    digest = hashlib.sha256()
    for file in sorted(folder.iterdir()):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


def hash_columns(columns: dict[str, np.ndarray]) -> str:
    """Of what the robot measured and was told, row by row."""
    digest = hashlib.sha256()
    for name in NUMBERS:
        digest.update(np.ascontiguousarray(columns[name], dtype=np.float32).tobytes())
    digest.update("\n".join(map(str, columns["subtask"])).encode())
    return digest.hexdigest()


def published_numbers(dataset: Path) -> Iterator[tuple[str, str]]:
    """Key and `hash_columns` of every episode of a dataset. Raises ValueError where a key is there twice."""
    ledger = read_ledger(dataset) or [] if dataset.exists() else []
    keys = [info.key for info in ledger]
    if twice := [key for key, count in Counter(keys).items() if count > 1]:
        raise ValueError(f"in the dataset twice: {', '.join(twice)}")
    for path in sorted(dataset.glob("data/*/*.parquet")):
        table = pq.read_table(path, columns=["episode_index", "subtask", *NUMBERS])
        episodes = table["episode_index"].to_numpy()
        columns = {name: np.stack(table[name].to_numpy()) for name in NUMBERS}
        columns["subtask"] = np.array(table["subtask"].to_pylist())
        for episode in np.unique(episodes):
            yield keys[episode], hash_columns({name: c[episodes == episode] for name, c in columns.items()})


class Trial:
    """A collection that is started and killed, again and again."""

    def __init__(self, said: argparse.Namespace) -> None:
        self._said, self._wanted = said, said.count
        self.collection = said.out / "collection"
        self.watch = Watch(self.collection)
        self._log = (said.out / "said.log").open("ab")

    def round(self, number: int, seconds: float | None) -> Round:
        """Start the command, kill it after so many seconds (None: let it finish), and look what is there."""
        attempts, left = self._attempts(), self._generations()
        began = time.monotonic()
        process = subprocess.Popen(  # noqa: S603 - our own command
            self._command(), stdout=self._log, stderr=self._log, start_new_session=True
        )
        while process.poll() is None and (seconds is None or time.monotonic() - began < seconds):
            self.watch.look()
            time.sleep(LOOKS)
        finished = process.poll() is not None
        publishing = bool(self._generations() - left)
        if not finished:
            os.killpg(process.pid, signal.SIGKILL)
        status = process.wait()
        phase = "publishing" if publishing else "collecting" if self._attempts() > attempts else "starting"
        done = Round(number, None if finished else round(time.monotonic() - began, 2), "done" if finished else phase)
        if finished and status != 0:
            done.problems.append(f"exit status {status}; {self._said.out / 'said.log'} may say why")
        if not gone(process.pid):
            done.problems.append(f"processes are left {GONE:g} s later")
        self._examine(done)
        return done

    def _generations(self) -> set[Path]:
        """Copies of the dataset that are being made, or that a kill left behind."""
        return set(self.collection.glob(".dataset.next/*"))

    def want_more(self) -> None:
        """The collection is complete; let there be something to kill."""
        self._wanted += self._said.count

    def examine_deeply(self, done: Round) -> None:
        """Decode every picture, count, and let lerobot open it."""
        done.problems += self._verify("--deep")
        if done.staged or done.published != self._wanted:
            done.problems.append(f"{done.published} in the dataset, {done.staged} staged; {self._wanted} wanted")
        opened = subprocess.run(  # noqa: S603 - likewise
            [self._said.lerobot_python or sys.executable, "-c", OPEN, self.collection / DATASET],
            capture_output=True, text=True, check=False, env=os.environ | {"HF_HUB_OFFLINE": "1"},
        )  # fmt: skip
        if opened.stdout.split()[-1:] != [str(self._wanted)]:
            done.problems.append(f"lerobot doesn't open it: {opened.stderr.strip().splitlines()[-1:]}")

    def _examine(self, done: Round) -> None:
        try:
            done.staged, done.published, problems = self.watch.check()
            done.problems += problems
        except (OSError, ValueError, KeyError, IndexError) as error:
            done.problems.append(f"{type(error).__name__}: {error}")
        done.committed = len(self.watch.keys)
        if (self.collection / DATASET).exists():
            done.problems += self._verify()

    def _verify(self, *more: str) -> list[str]:
        command = [sys.executable, "-m", "maniagent.cli", "data", "verify", self.collection / DATASET, "--json", *more]
        told = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - likewise
        found = json.loads(told.stdout) if told.stdout.strip() else {"problems": told.stderr}
        return [] if found["problems"] == 0 else [f"data verify: {found['problems']} problems"]

    def _command(self) -> list[str]:
        said = self._said
        command = [sys.executable, "-m", "maniagent.cli", "collect", said.task, "-n", str(self._wanted)]
        command += ["--out", str(self.collection), "--workers", str(said.workers), "--batch", str(said.batch)]
        command += ["--width", "64", "--height", "48", "--seed", str(said.seed)]
        return command + (["--lerobot-python", str(said.lerobot_python)] if said.lerobot_python else [])

    def _attempts(self) -> int:
        return sum(path.read_bytes().count(b"\n") for path in self.collection.glob("attempts-*.jsonl"))


def gone(group: int) -> bool:
    """Whether no process of a group runs any more, `GONE` seconds from now at the latest."""
    end = time.monotonic() + GONE
    while time.monotonic() < end:
        if not any(runs_in(group, stat) for stat in Path("/proc").glob("[0-9]*/stat")):
            return True
        time.sleep(LOOKS)
    return False


def runs_in(group: int, stat: Path) -> bool:
    """Whether the process of a /proc/PID/stat is one of the group, and more than the memory of one."""
    try:
        state, _, its_group = stat.read_text().rpartition(")")[2].split()[:3]
    except OSError:
        return False
    return state != "Z" and int(its_group) == group


def trial(said: argparse.Namespace, console: Console) -> list[Round]:
    """All rounds: the kills, those that finished too soon, and the last one, which is let finish."""
    rng = np.random.default_rng(said.seed)
    run, rounds, kills = Trial(said), [], 0
    while kills < said.kills:
        done = run.round(len(rounds), float(rng.uniform(0, said.seconds)))
        rounds.append(done)
        console.print(told(done), soft_wrap=True)
        kills += done.killed_after is not None
        if done.phase == "done":
            if done.problems:
                return rounds
            run.want_more()
    last = run.round(len(rounds), None)
    run.examine_deeply(last)
    console.print(told(last), soft_wrap=True)
    return [*rounds, last]


def told(done: Round) -> str:
    """One round in a line."""
    when = "finished" if done.killed_after is None else f"killed after {done.killed_after:.1f} s, {done.phase}"
    there = f"{done.committed} committed: {done.published} in the dataset, {done.staged} staged"
    return f"{done.number:3d}  {when}; {there}; {'; '.join(done.problems) or 'nothing lost'}"


def to_rows(rounds: list[Round]) -> list[tuple[str, str]]:
    """The figures."""
    killed = [done for done in rounds if done.killed_after is not None]
    phases = Counter(done.phase for done in killed)
    return [
        ("kills", f"{len(killed)} ({', '.join(f'{count} {phase}' for phase, count in sorted(phases.items()))})"),
        ("episodes committed in all", str(rounds[-1].committed)),
        ("in the dataset at the end", str(rounds[-1].published)),
        ("problems", str(sum(len(done.problems) for done in rounds))),
    ]


def write(rounds: list[Round], out: Path) -> None:
    """Write killed.json and killed.md."""
    (out / "killed.json").write_text(json.dumps([asdict(done) for done in rounds], indent=2) + "\n")
    lines = ["# A collection that is killed", "", "| what | figure |", "| --- | --- |"]
    lines += [f"| {name} | {figure} |" for name, figure in to_rows(rounds)]
    lines += ["", "| round | killed after | while | in the dataset | staged | problems |", "|---|---|---|---|---|---|"]
    for done in rounds:
        after = "–" if done.killed_after is None else f"{done.killed_after:.1f} s"
        found = "; ".join(done.problems) or "none"
        lines.append(f"| {done.number} | {after} | {done.phase} | {done.published} | {done.staged} | {found} |")
    (out / "killed.md").write_text("\n".join(lines) + "\n")


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description="Kills a collection again and again, and looks what is lost.")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("-n", "--count", type=int, default=24, help="episodes wanted")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--batch", type=int, default=3, help="episodes that go into the dataset at a time")
    parser.add_argument("--seconds", type=float, default=30.0, help="the latest moment of a kill")
    parser.add_argument("--task", default="carrot-on-plate")
    parser.add_argument("--seed", type=int, default=0, help="draws the moments, and the collection")
    parser.add_argument("--out", type=Path, required=True, help="a new folder")
    parser.add_argument("--lerobot-python", type=Path, default=os.environ.get("MANIAGENT_LEROBOT_PYTHON"))
    said = parser.parse_args()
    said.out.mkdir(parents=True)
    console = Console()
    rounds = trial(said, console)
    write(rounds, said.out)
    table = Table("what", "figure")
    for row in to_rows(rounds):
        table.add_row(*row)
    console.print(table)
    sys.exit(any(done.problems for done in rounds))


if __name__ == "__main__":
    main()
