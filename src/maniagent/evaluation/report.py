"""report.html: an evaluation on one page that needs nothing but a browser."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from PIL import Image

from ..console import page
from ..console.folder import REPORT
from ..console.page import badge, text
from ..console.story import read_story
from ..errors import UsageError
from .episode import FINAL_PICTURE
from .statistics import Rate, Row
from .summary import Failed, Summary
from .tables import Table, interval, interval_note, percent, published_table, result_table, stage_table, time_table

_THUMBNAIL = (320, 240)
"""px, at most."""
_GRID = "display:grid;grid-template-columns:repeat(auto-fill,minmax(250px,1fr));gap:16px"


def render(summary: Summary) -> str:
    """The page."""
    settings = summary.settings
    sections = [
        _header(summary),
        _headline(summary),
        _section("By task", _bars(summary) + _table(result_table(summary))),
        _section("Wall time", _table(times)) if (times := time_table(summary)).rows else "",
        _section("Failures by stage", _table(stage_table(summary)) if summary.stages else '<p class="quiet">None.</p>'),
        _failed(summary),
        _section("Published figures", _published(summary)) if summary.published else "",
        _footer(summary),
    ]
    title = f"{settings.suite}, {settings.actor} – maniagent eval"
    return page.page(title, "\n".join(section for section in sections if section))


def _header(summary: Summary) -> str:
    settings = summary.settings
    facts = {
        "actor": settings.actor,
        "tasks": len(settings.tasks),
        "episodes per task": f"{settings.episodes} × {settings.seeds} seeds",
        "finished": f"{summary.finished} of {summary.total}",
        "version": settings.version,
        **({"poses": settings.poses} if settings.poses else {}),
    }
    items = "".join(f"<div><dt>{text(name)}</dt><dd>{text(value)}</dd></div>" for name, value in facts.items())
    return (
        f'<header><p class="eyebrow">maniagent eval</p><h1>{text(settings.suite)}</h1>'
        f'<dl class="facts">{items}</dl></header>'
    )


def _headline(summary: Summary) -> str:
    if summary.average is None:
        return _section("Success", '<p class="quiet">No episode is finished.</p>')
    row = summary.average
    cards = [_rate_card("success, average over tasks", row.success)]
    cards += [_rate_card(name, rate) for name, rate in row.criteria.items()]
    if row.agreement is not None:
        cards.append(_rate_card("the actor’s own verdict is right", row.agreement))
    return f'<section class="verdict"><h2 class="unseen">Result</h2>{"".join(cards)}</section>'


def _rate_card(label: str, rate: Rate) -> str:
    of = f"{rate.episodes} episodes" + (f" of {rate.scenes} scenes" if rate.scenes < rate.episodes else "")
    return (
        f'<div class="card"><p class="eyebrow">{text(label)}</p><p class="big">{percent(rate.value)}</p>'
        f"<p>{interval(rate)} %, 95 % interval of {of}</p></div>"
    )


def _bars(summary: Summary) -> str:
    return f'<div class="totals" style="margin-bottom:16px"><ul>{"".join(map(_bar, summary.everything))}</ul></div>'


def _bar(row: Row) -> str:
    """A task's success as a bar, with its interval as a whisker."""
    rate = row.success
    whisker = f"left:{100 * rate.low:.1f}%;width:{100 * (rate.high - rate.low):.1f}%"
    return (
        f'<li style="grid-template-columns:minmax(120px,200px) 1fr 68px"><span class="name">{text(row.task)}</span>'
        f'<span class="track" style="position:relative;overflow:visible">'
        f'<i style="width:{100 * rate.value:.1f}%;background:var(--good)"></i>'
        f'<i title="95 % interval {interval(rate)}" style="position:absolute;top:3px;height:2px;{whisker};'
        f'background:var(--ink)"></i></span><span class="number">{percent(rate.value)}</span></li>'
    )


def _failed(summary: Summary) -> str:
    if not summary.failed:
        return ""
    cards = "".join(_failed_card(summary.out, failed) for failed in summary.failed)
    return f'<section><h2>Failed episodes</h2><div class="seen" style="{_GRID}">{cards}</div></section>'


def _failed_card(out: Path, failed: Failed) -> str:
    result = failed.result
    name = text(result.job.name)
    view = page_of = ""
    if result.folder:
        view = f"<figure>{_last_view(out / result.folder, f'Last view of {result.job.name}')}</figure>"
        if (out / result.folder / REPORT).is_file():
            page_of = f"{quote(result.folder)}/{REPORT}"
    heading = f'<a href="{text(page_of)}">{name}</a>' if page_of else name
    return (
        f'<article class="card">{view}<h3 style="margin:10px 0 6px;font-size:14px">{heading}</h3>'
        f"<p>{badge(result.stage, 'bad')}</p><p>{text(result.reason)}</p>"
        f"<p><code>{text(failed.repeat)}</code></p></article>"
    )


def _last_view(folder: Path, alt: str) -> str:
    """The last picture of the main view in a run folder, small and inlined; a note where there is none."""
    for path in _views(folder):
        try:
            with Image.open(path) as image:
                small = image.convert("RGB")
        except OSError:
            continue  # cut short when the episode broke off
        small.thumbnail(_THUMBNAIL)
        buffer = io.BytesIO()
        small.save(buffer, "JPEG", quality=82)
        data = base64.b64encode(buffer.getvalue()).decode()
        width, height = small.size
        return f'<img src="data:image/jpeg;base64,{data}" alt="{text(alt)}" width="{width}" height="{height}">'
    return f'<p class="missing">{text(alt)}: no picture</p>'


def _views(folder: Path) -> Iterator[Path]:
    """The pictures of the main view, the last one first."""
    yield folder / FINAL_PICTURE
    try:
        story = read_story(folder)
    except UsageError:
        return  # the episode broke off before its log began
    for turn in reversed(story.turns):
        if name := turn.pictures.get(turn.main_view):
            yield folder / name


def _published(summary: Summary) -> str:
    table = published_table(summary)
    rows = [(*row[:3], _link(row[3]), row[4]) for row in table.rows]
    return page.table(table.head, [[cell if i == 3 else text(cell) for i, cell in enumerate(row)] for row in rows])


def _link(source: str) -> str:
    return f'<a href="{text(source)}">{text(source)}</a>' if source.startswith("https://") else text(source)


def _table(table: Table) -> str:
    return page.table(table.head, [[text(cell) for cell in row] for row in table.rows], "figures")


def _section(title: str, content: str) -> str:
    return f'<section class="failures"><h2>{title}</h2>{content}</section>'


def _footer(summary: Summary) -> str:
    return (
        f"<footer><p>Written by maniagent {text(summary.settings.version)}. Success is the task’s own predicate on the "
        "true state at the end of an episode, which the actor never sees. "
        f"{text(interval_note(summary))}; that of the average is over all episodes. "
        "Turns, steps and seconds are medians. Beside this page: summary.json, "
        "summary.md, episodes.csv, results.jsonl.</p></footer>"
    )
