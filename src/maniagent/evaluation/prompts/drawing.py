"""Pictures of the scenes in which something that matters was missed: where it is, and who missed it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from .scenes import LabelledScene
from .scores import Result

MISSES = "misses"
"""Folder of the pictures, in that of the comparison."""
_INK, _PAPER = (255, 255, 255), (190, 24, 60)


def picture_of(out: Path, scene: str) -> Path:
    """Where the picture of a scene lies, if it has one."""
    return out / MISSES / f"{scene}.png"


def keep_misses(out: Path, scene: LabelledScene, results: Sequence[Result]) -> None:
    """Draw the scene with what was missed in it; where nothing was, there is no picture of it."""
    missed_by: dict[str, list[str]] = {}
    for result in results:
        for thing in result.matching.missed:
            missed_by.setdefault(thing.name, []).append(result.answer.variant)
    path = picture_of(out, scene.name)
    if not missed_by:
        path.unlink(missing_ok=True)
        return
    image = Image.fromarray(scene.observation.main_frame.rgb)
    for name, variants in missed_by.items():
        _ring(image, scene.spots[name], f"{name}: {', '.join(variants)}")
    path.parent.mkdir(exist_ok=True)
    image.save(path)


def _ring(image: Image.Image, spot: tuple[float, float, float], label: str) -> None:
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(14)
    u, v, radius = spot
    draw.ellipse((u - radius, v - radius, u + radius, v + radius), outline=_PAPER, width=3)
    width = draw.textlength(label, font=font) + 10
    x = min(max(0.0, u - width / 2), max(0.0, image.width - width))
    y = min(v + radius + 2, image.height - 20.0)
    draw.rectangle((x, y, x + width, y + 19), fill=_PAPER)
    draw.text((x + 5, y + 2), label, font=font, fill=_INK)
