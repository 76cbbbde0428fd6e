"""One turn of a run as a card of the report: seen, decided, done, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from . import page
from .page import badge, text
from .story import Story, Turn

Json = dict[str, Any]

_PARTS = {
    "centre": "middle",
    "grasp": "grasp",
    "surface": "where things rest on it",
    "free": "where it is free",
    "top": "top",
    "base": "underside",
    "left": "left of it",
    "right": "right of it",
    "near": "before it",
    "far": "behind it",
}


def turn_card(story: Story, turn: Turn) -> str:
    """The card of one turn, as HTML."""
    label, tone = _outcome(turn)
    main = "".join((_decided(turn), _objects(turn), _sequence(turn), _happened(turn)))
    return (
        f'<article class="turn {tone}" id="turn-{turn.number}"><div class="node" aria-hidden="true">{turn.number}</div>'
        f'<div class="card"><header><h3><span class="unseen">Turn {turn.number}: </span>{text(_headline(turn))}</h3>'
        f"{badge(label, tone)}{_play(story, turn)}</header>"
        f'<div class="columns"><div class="seen">{_pictures(story, turn)}</div><div class="told">{main}</div></div>'
        f"{_stages(turn)}</div></article>"
    )


def _headline(turn: Turn) -> str:
    if turn.subtask.get("done"):
        return "Nothing is left to do"
    if turn.subtask.get("cannot"):
        return "It can’t be done"
    return turn.subtask.get("text") or "No sub-task came out of this turn"


def _outcome(turn: Turn) -> tuple[str, str]:
    if turn.subtask.get("done"):
        return "done", "good"
    if turn.subtask.get("cannot"):
        return "given up", "bad"
    judged = turn.judged.get("previous")
    if judged == "success":
        return "success", "good"
    if judged == "failure":
        return "failure", "bad"
    if turn.failures:
        return f"failed: {turn.failures[-1]['stage']}", "bad"
    if turn.report:
        return ("carried out", "neutral") if turn.report["completed"] else (f"failed: {turn.report['stage']}", "bad")
    return "cut short", "warn"


def _play(story: Story, turn: Turn) -> str:
    if turn.video_start is None or story.video is None:
        return ""
    minutes, seconds = divmod(int(turn.video_start), 60)
    return (
        f'<button type="button" data-seek="{turn.video_start:.2f}" aria-label="Play turn {turn.number} in the video">'
        f"▶ {minutes}:{seconds:02d}</button>"
    )


def _pictures(story: Story, turn: Turn) -> str:
    if not turn.picture:
        return '<p class="missing">Nothing was seen.</p>'
    caption = "What was found, and how it will be grasped" if turn.detections_picture else "Main view"
    shown = page.picture(story.folder / turn.picture, f"Turn {turn.number}: {caption.lower()}")
    figure = f"<figure>{shown}<figcaption>{caption}</figcaption></figure>"
    rest = [(name, path) for name, path in turn.pictures.items() if path != turn.picture]
    if not rest:
        return figure
    others = "".join(
        f"<figure>{page.picture(story.folder / path, f'Turn {turn.number}: {name}')}"
        f"<figcaption>{text(name)}</figcaption></figure>"
        for name, path in rest
    )
    return f'{figure}<details open><summary>All views and depth</summary><div class="views">{others}</div></details>'


def _decided(turn: Turn) -> str:
    subtask = turn.subtask
    scene = f'<h4>Seen</h4><p class="lines">{text(turn.scene["text"])}</p>' if turn.scene.get("text") else ""
    if not subtask:
        return scene
    if subtask["previous"] == "initial":
        why = f"<p>{text(subtask['reason'])}</p>" if subtask["reason"] else ""
    else:
        tone = "good" if subtask["previous"] == "success" else "bad"
        verdict = badge(f"previous: {subtask['previous']}", tone)
        why = f"<p>{verdict} {text(subtask['reason'])}</p>"
    return f"{scene}<h4>Decided</h4>{why}" if why else scene


def _objects(turn: Turn) -> str:
    if not turn.objects:
        return ""
    rows = []
    for thing in turn.objects:
        length, width, height = (100 * side for side in thing["extent"])
        grasp = f"{thing['grasps'][0]['score']:.2f}" if thing["grasps"] else "–"
        swatch = "".join(f"{round(channel):02x}" for channel in thing["colour"])
        rows.append(
            (
                str(thing["index"]),
                f'<i class="swatch" style="background:#{swatch}"></i>{text(thing["name"])}',
                _point(thing["centre"]),
                f"{length:.1f} × {width:.1f} × {height:.1f} cm",
                f"{math.degrees(thing['yaw']):.0f}°",
                grasp,
            )
        )
    head = ("#", "object", "centre (m)", "size", "yaw", "grasp")
    return f"<h4>Located</h4>{page.table(head, rows, 'figures')}"


def _sequence(turn: Turn) -> str:
    if not turn.sequence:
        return ""
    names = {thing["index"]: thing["name"] for thing in turn.objects}
    steps = turn.sequence["steps"]
    reached = turn.report.get("reached", len(steps) if turn.report.get("completed") else 0)
    rows = [
        (
            f'<span class="{"reached" if number <= reached else "unreached"}">{number}</span>',
            text(step["description"]),
            _where(step, names),
            _turned(step["orientation"], names),
            {"open": "open", "close": "close", "keep": "–"}[step["gripper"]],
        )
        for number, step in enumerate(steps, 1)
    ]
    head = ("#", "step", "where", "hand", "fingers")
    return f"<h4>Action sequence · {text(turn.sequence['skill'])}</h4>{page.table(head, rows, 'steps')}"


def _where(step: Json, names: dict[int, str]) -> str:
    anchor = step["anchor"]
    if "index" in anchor:
        place = f"{_object(anchor['index'], names)}, {_PARTS.get(anchor['part'], anchor['part'])}"
    elif "here" in anchor:
        place = "from there"
    else:
        place = _point((anchor["x"], anchor["y"], anchor["z"]))
    place += _offset(step["offset"], step.get("offset_frame", "base"))
    if step["carrying"] is not None:
        place += f" <small>carrying {_object(step['carrying'], names)}</small>"
    return place


def _offset(offset: Sequence[float], frame: str) -> str:
    x, y, z = offset
    if x or y:
        return f" + {_point(offset)}" + (" as the viewer sees it" if frame == "viewer" else "")
    return f" {100 * z:+.1f} cm up" if z else ""


def _turned(orientation: Json, names: dict[int, str]) -> str:
    degrees = f"{math.degrees(orientation['yaw']):.0f}°"
    match orientation["kind"]:
        case "grasp":
            return f"as for grasping {_object(orientation['index'], names)}"
        case "top-down":
            return f"straight down, {degrees}"
        case "turn":
            return f"turned by {degrees}"
    return "–"


def _object(index: int, names: dict[int, str]) -> str:
    return text(names.get(index, f"object {index}"))


def _point(point: Any) -> str:
    return "(" + ", ".join("–" if value is None else f"{value:.3f}" for value in point) + ")"


def _happened(turn: Turn) -> str:
    lines = []
    if turn.report:
        if turn.report["completed"]:
            steps = turn.report["reached"]
            lines.append(f"{badge('carried out', 'good')} All {steps} key points were reached.")
        else:
            stage = badge(turn.report["stage"] or "stopped", "bad")
            lines.append(f"{stage} After {turn.report['reached']} key points: {text(turn.report['reason'])}")
    reported = turn.report.get("reason")
    lines += [f"{badge(f['stage'], 'bad')} {text(f['reason'])}" for f in turn.failures if f["reason"] != reported]
    told = {reported, *(failure["reason"] for failure in turn.failures)}
    if turn.judged.get("previous") in ("success", "failure") and turn.judged["reason"] not in told:
        tone = "good" if turn.judged["previous"] == "success" else "bad"
        lines.append(f"{badge('judged ' + turn.judged['previous'], tone)} {text(turn.judged['reason'])}")
    return "<h4>Happened</h4>" + "".join(f"<p>{line}</p>" for line in lines) if lines else ""


def _stages(turn: Turn) -> str:
    total = sum(span.seconds for span in turn.spans)
    bar = page.stage_bar(turn.spans, total)
    words = " · ".join(
        f'<span><i class="dot stage-{text(span.stage)}"></i>{text(span.label)} {span.seconds:.2f} s</span>'
        for span in turn.spans
        if span.seconds >= 0.005
    )
    return f'<footer>{bar}<p class="legend">{words}</p></footer>'
