"""report.html: one run, told on one page that needs nothing but a browser."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from .. import __version__
from . import page
from .folder import REPORT
from .page import text
from .story import STAGES, Story, read_story
from .turns import turn_card

_VERDICTS = {
    "achieved": ("Achieved", "good"),
    "cannot": ("Given up", "bad"),
    "out_of_budget": ("Out of budget", "bad"),
    "aborted": ("Stopped", "bad"),
}


def write_report(folder: Path) -> Path:
    """Write report.html into a run folder, from what lies in it, and return its path.

    Works for a run that was cut short, too. Raises UsageError where `folder` is no run folder.
    """
    story = read_story(folder)
    path = folder / REPORT
    path.write_text(render(story), encoding="utf-8")
    return path


def render(story: Story) -> str:
    """The page."""
    instruction = story.start.get("instruction", "")
    sections = [_header(story), _verdict(story), _overview(story), _timeline(story)]
    if story.turns:
        cards = "\n".join(turn_card(story, turn) for turn in story.turns)
        sections.append(f'<section class="turns"><h2>Turn by turn</h2>\n{cards}\n</section>')
    sections += [_failures(story), _footer()]
    return page.page(f"{instruction} – maniagent", "\n".join(section for section in sections if section))


def _header(story: Story) -> str:
    start = story.start
    facts = {
        "task": start.get("task") or "–",
        "seed": start.get("seed", "–"),
        "agents": start.get("agents") or "–",
        "turns": len(story.turns),
        "wall time": f"{story.seconds:.1f} s",
    }
    items = "".join(f"<div><dt>{text(name)}</dt><dd>{text(value)}</dd></div>" for name, value in facts.items())
    return (
        f'<header><p class="eyebrow">maniagent run</p><h1>{text(start.get("instruction", "(no instruction)"))}</h1>'
        f'<dl class="facts">{items}</dl></header>'
    )


def _verdict(story: Story) -> str:
    title = '<h2 class="unseen">Verdict</h2>'
    if not story.finish:
        note = "The log ends before the agents came to a verdict."
        return f'<section class="verdict">{title}{_card("the run", "Cut short", note, "warn")}</section>'
    result, achieved = story.finish["result"], story.finish["achieved"]
    believed, tone = _VERDICTS[result["verdict"]]
    truth, truth_tone, note = {
        True: ("Achieved", "good", "The task’s own check on the true state of the scene holds."),
        False: ("Not achieved", "bad", "The task’s own check on the true state of the scene does not hold."),
        None: ("Not known", "neutral", "This scene has no check on its true state."),
    }[achieved]
    wrong = achieved is not None and achieved != (result["verdict"] == "achieved")
    warning = '<p class="mismatch">The agents’ belief and the truth differ.</p>' if wrong else ""
    believes = _card("what the agents believe", believed, result["reason"], tone)
    knows = _card("what is true", truth, note, truth_tone)
    return f'<section class="verdict">{title}{believes}{knows}{warning}</section>'


def _card(label: str, word: str, note: str, tone: str) -> str:
    return f'<div class="card {tone}"><p class="eyebrow">{label}</p><p class="big">{word}</p><p>{text(note)}</p></div>'


def _overview(story: Story) -> str:
    film = f'<figure class="film">{page.video(story.video)}</figure>' if story.video else ""
    seconds = story.seconds_by_stage()
    longest = max(seconds.values(), default=0.0) or 1.0
    rows = "".join(
        f'<li><span class="name"><i class="dot stage-{text(stage)}"></i>{text(stage)}</span>'
        f'<span class="track"><i class="stage-{text(stage)}" style="width:{100 * spent / longest:.1f}%"></i></span>'
        f'<span class="number">{spent:.2f} s</span></li>'
        for stage, spent in sorted(seconds.items(), key=lambda item: _order(item[0]))
    )
    totals = f'<div class="totals"><h2>Seconds per stage</h2><ul>{rows}</ul></div>'
    return f'<section class="overview">{film}{totals}</section>'


def _order(stage: str) -> int:
    return STAGES.index(stage) if stage in STAGES else len(STAGES)


def _timeline(story: Story) -> str:
    spans = [span for turn in story.turns for span in turn.spans]
    total = sum(span.seconds for span in spans)
    if total <= 0:
        return ""
    marks = "".join(
        f'<a href="#turn-{turn.number}" style="left:{100 * (turn.spans[0].start - spans[0].start) / total:.2f}%">'
        f"{turn.number}</a>"
        for turn in story.turns
    )
    bar = page.stage_bar(spans, total)
    return (
        f'<section class="timeline"><h2>Timeline</h2>{bar}<nav aria-label="Turns" class="marks">{marks}</nav>'
        f'<p class="scale"><span>0 s</span><span>{total:.1f} s</span></p></section>'
    )


def _failures(story: Story) -> str:
    by_stage: dict[str, list[str]] = defaultdict(list)
    for stage, number, reason in story.failures():
        by_stage[stage].append(f'<a href="#turn-{number}">turn {number}</a>: {text(reason)}')
    if not by_stage:
        return '<section class="failures"><h2>Failures</h2><p class="quiet">None.</p></section>'
    rows = ((text(stage), str(len(reasons)), "<br>".join(reasons)) for stage, reasons in sorted(by_stage.items()))
    listing = page.table(("stage", "count", "what happened"), rows)
    return f'<section class="failures"><h2>Failures by stage</h2>{listing}</section>'


def _footer() -> str:
    return (
        f"<footer><p>Written by maniagent {text(__version__)}. Metres and degrees in the robot’s base frame: "
        "x forward, y left, z up. The folder of this page holds the log, the pictures, the action sequences and the "
        "video.</p></footer>"
    )
