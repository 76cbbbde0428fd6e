import io

import synthetic
from rich.console import Console

from maniagent.console.progress import Progress


def shown(*, terminal: bool, instruction: str = synthetic.INSTRUCTION) -> str:
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=terminal, width=120, color_system=None)
    with Progress(console, clock=lambda: 0.0) as progress:
        for event in synthetic.events(instruction, size=(32, 24), frames=1):
            progress.on_event(event)
    return stream.getvalue()


def test_without_a_terminal_there_is_one_plain_line_a_finished_turn() -> None:
    slipped = "grasp: the carrot slipped out of the fingers while it was lifted"
    assert shown(terminal=False).splitlines() == [
        "› put the carrot on the plate",
        f"✗ turn 1  put the carrot on the plate  {slipped}  1.1 s",
        "✓ turn 2  put the carrot on the plate  carried out  1.6 s",
    ]


def test_on_a_terminal_the_same_lines_stay_and_the_spinner_goes() -> None:
    text = shown(terminal=True)
    assert "✓ turn 2  put the carrot on the plate  carried out" in text
    assert "looking at the table" in text


def test_an_instruction_is_never_read_as_markup() -> None:
    assert "[bold]put[/] [nonsense" in shown(terminal=False, instruction="[bold]put[/] [nonsense")
