"""The coverage map says what happened: marks lie where they belong, in the viewer's directions, and none gets lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from maniagent.data.chart import Chart
from maniagent.data.coverage import COLOURS, REACHABLE, TABLE, Covered, Tried, draw_coverage
from maniagent.data.reach import Reach
from maniagent.data.starts import Region, Start, plan_starts
from maniagent.motion import ArmModel, MotionLimits
from maniagent.perception.viewpoint import Viewpoint

FROM_THE_FRONT = Viewpoint(np.array([0.0, 1.0]), np.array([-1.0, 0.0]))
FROM_BEHIND = Viewpoint(np.array([0.0, -1.0]), np.array([1.0, 0.0]))
ASLANT = Viewpoint(np.array([0.8, 0.6]), np.array([-0.6, 0.8]))


@pytest.fixture(scope="module")
def region() -> Region:
    return Region(Reach(ArmModel(), MotionLimits()))


def chart_of(region: Region, viewpoint: Viewpoint) -> Chart:
    corners = [(x, y) for x in region.workspace.x for y in region.workspace.y]
    base = [(0.048, 0.048), (-0.048, -0.048), (0.048, -0.048), (-0.048, 0.048)]
    return Chart.around(np.array(corners + base), viewpoint)


def colour_at(picture: Path, pixel: np.ndarray) -> tuple[int, ...]:
    with Image.open(picture) as image:
        return image.getpixel(tuple(int(value) for value in pixel))


@pytest.mark.parametrize("viewpoint", [FROM_THE_FRONT, FROM_BEHIND, ASLANT])
def test_marks_lie_where_episodes_were_seen_to_begin(tmp_path: Path, region: Region, viewpoint: Viewpoint) -> None:
    planned = tuple(Start(i, (0.25, y), 0.4) for i, y in enumerate((-0.2, 0.0, 0.2)))
    began = ((0.22, -0.2), None, (0.25, 0.23))
    tried = [Tried(start.xy, label, xy) for start, label, xy in zip(planned, COLOURS, began, strict=True)]
    picture = draw_coverage([Covered(region, planned, tried)], viewpoint, tmp_path / "new" / "coverage.png")
    chart = chart_of(region, viewpoint)
    for episode in tried:
        place = chart.pixel(np.array(episode.began or episode.planned))
        assert colour_at(picture, place) == pytest.approx(COLOURS[episode.label], abs=6)


@pytest.mark.parametrize("viewpoint", [FROM_THE_FRONT, FROM_BEHIND, ASLANT])
def test_the_shade_is_the_region(tmp_path: Path, region: Region, viewpoint: Viewpoint) -> None:
    picture = draw_coverage([Covered(region, (), ())], viewpoint, tmp_path / "coverage.png")
    chart = chart_of(region, viewpoint)
    for xy, colour in (((0.25, 0.15), REACHABLE), ((0.33, -0.12), REACHABLE), ((0.48, 0.33), TABLE)):
        assert colour_at(picture, chart.pixel(np.array(xy))) == pytest.approx(colour, abs=6)


def test_what_is_to_the_viewers_right_is_to_the_right_and_what_is_far_is_up(region: Region) -> None:
    for viewpoint in (FROM_THE_FRONT, FROM_BEHIND, ASLANT):
        chart = chart_of(region, viewpoint)
        here, right, away = (
            chart.pixel(np.array([0.3, 0.0]) + step) for step in (0.0, 0.1 * viewpoint.right, 0.1 * viewpoint.away)
        )
        assert right - here == pytest.approx([130.0, 0.0], abs=1e-6)
        assert away - here == pytest.approx([0.0, -130.0], abs=1e-6)


def test_the_same_collection_gives_the_same_picture(tmp_path: Path, region: Region) -> None:
    planned = plan_starts(region, 30)
    tried = [Tried(start.xy, "valid", start.xy) for start in planned[:20]]
    pictures = [
        draw_coverage([Covered(region, planned, tried)], FROM_THE_FRONT, tmp_path / name) for name in ("a.png", "b.png")
    ]
    assert pictures[0].read_bytes() == pictures[1].read_bytes()


@pytest.mark.parametrize("count", [1, 1000])
def test_few_and_many_starts_all_show(tmp_path: Path, region: Region, count: int) -> None:
    planned = plan_starts(region, count)
    tried = [Tried(start.xy, "failed", start.xy) for start in planned]
    picture = draw_coverage([Covered(region, planned, tried)], FROM_THE_FRONT, tmp_path / "coverage.png")
    chart = chart_of(region, FROM_THE_FRONT)
    with Image.open(picture) as image:
        pixels = np.asarray(image).astype(int)
    red = np.abs(pixels - COLOURS["failed"]).sum(axis=-1) < 90
    for start in planned:
        u, v = chart.pixel(np.array(start.xy)).astype(int)
        assert red[v - 3 : v + 4, u - 3 : u + 4].any(), start
