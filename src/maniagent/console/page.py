"""Pieces of a self-contained HTML page: escaped text, inlined pictures and video, tables, badges.

Whatever comes from outside (an instruction, a model's words, an error) passes through `text` on its way into the
page; the page's content policy forbids every script but our own and every request to anywhere.
"""

from __future__ import annotations

import base64
import hashlib
import html
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from .story import Span

SEEK_SCRIPT = """
document.addEventListener("click", (event) => {
  const button = event.target.closest("[data-seek]");
  const video = document.querySelector("video");
  if (!button || !video) return;
  video.currentTime = Number(button.dataset.seek);
  video.scrollIntoView({ behavior: "smooth", block: "center" });
  video.play();
});
"""

_JPEG_QUALITY = 86
_CONTROLS = dict.fromkeys((*range(9), 11, 12, *range(14, 32), *range(127, 160), *range(0xD800, 0xE000), 0xFFFE, 0xFFFF))
"""Characters that may not stand in an HTML document."""


def text(value: Any) -> str:
    """`value` as HTML text, safe between tags and inside quoted attributes."""
    return html.escape(str(value).translate(_CONTROLS), quote=True)


def page(title: str, body: str) -> str:
    """A whole HTML document with our style sheet."""
    style = Path(__file__).with_name("report.css").read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(SEEK_SCRIPT.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    )
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="color-scheme" content="light dark">
<title>{text(title)}</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
</main>
<script>{SEEK_SCRIPT}</script>
</body>
</html>
"""


def picture(path: Path, alt: str) -> str:
    """The picture at `path` inlined as JPEG; a note where it is missing or was cut short by a crash."""
    try:
        with Image.open(path) as image:
            buffer = io.BytesIO()
            image.convert("RGB").save(buffer, "JPEG", quality=_JPEG_QUALITY, optimize=True)
    except OSError:
        return f'<p class="missing">{text(alt)}: no picture</p>'
    data = base64.b64encode(buffer.getvalue()).decode()
    width, height = image.size
    return f'<img src="data:image/jpeg;base64,{data}" alt="{text(alt)}" width="{width}" height="{height}">'


def video(path: Path) -> str:
    """The MP4 at `path` inlined."""
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<video controls muted playsinline preload="auto" src="data:video/mp4;base64,{data}"></video>'


def badge(label: str, tone: str = "neutral") -> str:
    """A small label; `tone` is good, bad, warn or neutral."""
    return f'<span class="badge {tone}">{text(label)}</span>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> str:
    """A table; the cells are HTML already. Scrolls by itself where the page is narrow."""
    top = "".join(f'<th scope="col">{text(cell)}</th>' for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    opening = f'<table class="{kind}">' if kind else "<table>"
    return f'<div class="scroll">{opening}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def stage_bar(spans: Iterable[Span], total: float) -> str:
    """A stacked bar of stages, `total` seconds wide."""
    parts = []
    for span in spans:
        share = 100 * span.seconds / total if total > 0 else 0.0
        if share >= 0.05:
            label = f"{text(span.label)}: {span.seconds:.2f} s"
            parts.append(f'<i class="stage-{text(span.stage)}" style="width:{share:.2f}%" title="{label}"></i>')
    return f'<div class="bar">{"".join(parts)}</div>'
