"""Sub-task requests to a language model on scenes of the twin: how many of its answers can be used.

    python benchmarks/subtask_requests.py --llm llamacpp:qwen@http://127.0.0.1:8080/v1 [--requests 100] [--out FOLDER]

Every request is a scene of its own. The ReasoningAgent is asked for the first sub-task, the scene told in words from
what segmentation and the lexicon see; then the ControllerAgent is asked for the movements of that sub-task, or of the
rule-made one where the model named none whose objects are found. Agents, prompts, repairs, loop, binding and motion
gate are those of a run, and what passes the gate is carried out in the twin.

That nothing malformed reaches the robot is checked without the gate's code (`requesting/watch.py`): the accepted
sequence's JSON is read by hand; key points are looked at on their way in, and compared with those that were accepted;
and every command to the servos is watched, as is where MuJoCo then has the arm.

All reasoning questions come first, so that a server that keeps a prompt's prefix reads each role's long instructions
once (`--order requests` goes request by request). Every answer is kept; the same command goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

NEEDS_A_MODEL = """\
This benchmark asks a language model, and none is named. Name one, for example:
    python benchmarks/subtask_requests.py --llm llamacpp:any@http://127.0.0.1:8080/v1
    python benchmarks/subtask_requests.py --llm openai:gpt-5 --requests 20"""


def parse_arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--llm", metavar="PROVIDER:MODEL[@URL]", help="the model that is asked")
    parser.add_argument("--requests", dest="count", type=int, default=100, help="how many requests there are (100)")
    parser.add_argument("--limit", type=int, help="ask at most so many questions in this call")
    parser.add_argument("--out", type=Path, default=Path("runs/requests"), help="folder of the results (runs/requests)")
    parser.add_argument("--prompts", type=Path, help="folder with prompts of one's own")
    parser.add_argument("--order", choices=("roles", "requests"), default="roles", help="what is asked first (roles)")
    parser.add_argument("--temperature", type=float, help="of the sampling (the server's own, as in a run)")
    parser.add_argument("--timeout", type=float, default=900.0, help="seconds for one answer (900)")
    parser.add_argument("--max-tokens", type=int, default=1200, help="of one answer (1200)")
    return parser.parse_args()


def main() -> int:
    """Ask, and print the page."""
    said = parse_arguments()
    if said.llm is None:
        print(NEEDS_A_MODEL)
        return 0
    from maniagent.errors import ManiAgentError
    from requesting.runner import Settings, run

    try:
        page = run(Settings(**vars(said)))
    except ManiAgentError as error:
        print(f"{error} What was answered is kept; the same command goes on from there.", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Stopped with Ctrl-C; the same command goes on from there.", file=sys.stderr)
        return 130
    print(page)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
