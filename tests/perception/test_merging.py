"""Which regions are one thing after all: each rule on a small made table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from maniagent.geometry import FloatArray
from maniagent.perception.heightmap import HeightMap
from maniagent.perception.merging import merge_regions
from maniagent.perception.segmentation import find_supports, split_regions

CELL = 0.002
RED, DARK_RED, GREEN, BLUE, YELLOW, WHITE, GREY = (
    (190, 30, 30),
    (100, 14, 14),
    (50, 140, 50),
    (40, 60, 180),
    (230, 195, 40),
    (240, 240, 236),
    (150, 150, 154),
)
Shape = Callable[[FloatArray, FloatArray], FloatArray]


class Table:
    """A height map and its regions, drawn thing by thing; positions are m from the middle."""

    def __init__(self) -> None:
        shape = (120, 120)
        self.height = np.zeros(shape, np.float32)
        self.rgb = np.zeros((*shape, 3), np.uint8)
        self.labels = np.zeros(shape, np.int32)
        rows, columns = np.indices(shape)
        self.x, self.y = (rows - 59.5) * CELL, (columns - 59.5) * CELL

    def put(self, where: np.ndarray, height: float | FloatArray, colour: tuple[int, int, int]) -> int:
        """A region where a mask is true; returns its number."""
        self.labels[where] = label = int(self.labels.max()) + 1
        self.height[where] = np.broadcast_to(height, self.height.shape)[where]
        self.rgb[where] = colour
        return label

    def box(self, x: float, y: float, length: float, width: float, height: float, colour: tuple[int, int, int]) -> int:
        """An upright box: `length` along x, `width` along y. Boxes side by side share no cell and leave none out."""
        along, across = self.x - x + length / 2 + 1e-6, self.y - y + width / 2 + 1e-6
        return self.put((along >= 0) & (along < length) & (across >= 0) & (across < width), height, colour)

    def ring(self, inner: float, outer: float, height: float, colour: tuple[int, int, int]) -> int:
        """A ring about the middle."""
        radius = np.hypot(self.x, self.y)
        return self.put((radius >= inner) & (radius < outer), height, colour)

    @property
    def grid(self) -> HeightMap:
        return HeightMap((0.16, -0.12), CELL, self.height, self.rgb, self.labels > 0, self.labels == 0)

    def merged(self) -> np.ndarray:
        """The labels after merging."""
        return merge_regions(self.labels, self.grid)

    def count(self) -> int:
        """How many things there are."""
        return len(np.unique(self.merged()[self.labels > 0]))


@pytest.fixture
def table() -> Table:
    return Table()


def test_an_empty_table_stays_empty(table: Table) -> None:
    assert not table.merged().any()


def test_nothing_gets_lost_and_nothing_grows(table: Table) -> None:
    table.box(0.0, 0.0, 0.04, 0.04, 0.03, RED)
    table.box(0.04, 0.0, 0.04, 0.04, 0.03, BLUE)
    np.testing.assert_array_equal(table.merged() > 0, table.labels > 0)


# One thing ------------------------------------------------------------------------------------------------------------


def test_parts_of_one_colour_and_level_are_one_surface(table: Table) -> None:
    table.box(0.0, -0.01, 0.03, 0.02, 0.03, RED)
    table.box(0.0, 0.01, 0.03, 0.02, 0.032, RED)
    assert table.count() == 1


def test_the_shaded_side_belongs_to_the_lit_one(table: Table) -> None:
    table.ring(0.0, 0.014, 0.03, RED)
    table.ring(0.014, 0.03, 0.022, DARK_RED)
    assert table.count() == 1


def test_the_pale_side_of_a_glossy_thing_belongs_to_it(table: Table) -> None:
    table.box(0.0, -0.006, 0.08, 0.012, 0.024, (110, 190, 40))
    table.box(0.0, 0.003, 0.08, 0.006, 0.022, (196, 232, 160))
    assert table.count() == 1


def spoon(table: Table, gap: float, *, tip: float = 0.008, aside: float = 0.0) -> None:
    """A handle that narrows to a tip, and a head beyond a neck that isn't seen."""
    table.box(0.04, 0.0, 0.06, 0.022, 0.024, GREEN)
    table.box(0.0, 0.0, 0.02, tip, 0.006, GREEN)
    table.box(-0.01 - gap - 0.02, aside, 0.04, 0.03, 0.008, WHITE)


def test_a_spoon_whose_neck_is_too_flat_to_be_seen_is_one(table: Table) -> None:
    spoon(table, gap=0.008)
    assert table.count() == 1


@pytest.mark.parametrize("parted", [{"gap": 0.02}, {"gap": 0.008, "aside": 0.014}, {"gap": 0.008, "tip": 0.022}])
def test_what_is_not_at_the_thin_end_of_a_handle_is_no_head(table: Table, parted: dict[str, float]) -> None:
    spoon(table, **parted)
    assert table.count() == 2


def test_a_stem_belongs_to_what_it_grows_from(table: Table) -> None:
    table.box(0.0, 0.0, 0.04, 0.04, 0.03, RED)
    table.box(0.03, 0.0, 0.02, 0.015, 0.02, GREEN)
    assert table.count() == 1


def test_a_print_belongs_to_its_plate(table: Table) -> None:
    table.ring(0.0, 0.05, 0.02, WHITE)
    table.ring(0.02, 0.03, 0.02, BLUE)
    assert table.count() == 1


def test_a_cloth_of_two_halves_is_one_thing(table: Table) -> None:
    table.box(0.0, -0.025, 0.1, 0.05, 0.004, WHITE)
    table.box(0.0, 0.025, 0.1, 0.05, 0.004, RED)
    assert table.count() == 1


def test_bottom_and_walls_are_one_vessel(table: Table) -> None:
    table.ring(0.0, 0.04, 0.005, WHITE)
    table.ring(0.04, 0.05, 0.028, GREY)
    assert table.count() == 1


def test_a_rim_with_a_gap_still_holds_water(table: Table) -> None:
    table.ring(0.0, 0.04, 0.005, WHITE)
    radius, angle = np.hypot(table.x, table.y), np.arctan2(table.y, table.x)
    table.put((radius >= 0.04) & (radius < 0.05) & (abs(angle) > 0.08), 0.028, GREY)
    assert table.count() == 1


def test_cap_and_pen_are_one_long_thing(table: Table) -> None:
    table.box(-0.03, 0.0, 0.06, 0.016, 0.016, BLUE)
    table.box(0.03, 0.0, 0.06, 0.016, 0.016, WHITE)
    assert table.count() == 1


def test_head_and_body_of_one_colour_are_one_toy(table: Table) -> None:
    table.box(0.0, 0.0, 0.03, 0.03, 0.026, YELLOW)
    table.box(0.025, 0.0, 0.02, 0.024, 0.05, YELLOW)
    assert table.count() == 1


def test_a_cloth_parted_by_a_fork_is_one_cloth(table: Table) -> None:
    table.box(-0.03, 0.0, 0.04, 0.1, 0.004, WHITE)
    table.box(0.03, 0.0, 0.04, 0.1, 0.004, WHITE)
    fork = table.box(0.0, 0.0, 0.02, 0.11, 0.012, GREY)
    merged = table.merged()
    assert len(np.unique(merged[table.labels > 0])) == 2
    assert (merged[table.labels == fork] == fork).all()


def test_the_parts_of_a_sink_are_no_limbs_of_each_other(table: Table) -> None:
    table.box(-0.06, 0.0, 0.11, 0.22, 0.07, GREY)
    table.box(0.055, 0.0, 0.12, 0.22, 0.12, GREY)
    assert table.count() == 2


def test_a_fruit_level_with_a_rim_is_no_part_of_it(table: Table) -> None:
    table.box(0.0, -0.05, 0.2, 0.1, 0.1, YELLOW)
    table.box(0.02, 0.015, 0.06, 0.03, 0.1, RED)
    assert table.count() == 2


# Two things -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [0.0, 0.01, 0.03])
def test_blocks_of_two_colours_side_by_side_are_two(table: Table, step: float) -> None:
    table.box(-0.015, 0.0, 0.03, 0.03, 0.03, RED)
    table.box(0.015, 0.0, 0.03, 0.03, 0.03 + step, BLUE)
    assert table.count() == 2


@pytest.mark.parametrize("colour", [RED, GREY, BLUE])
def test_what_lies_in_a_vessel_is_not_the_vessel(table: Table, colour: tuple[int, int, int]) -> None:
    table.ring(0.0, 0.06, 0.005, WHITE)
    table.ring(0.06, 0.07, 0.025, WHITE)
    table.box(0.0, 0.0, 0.06, 0.026, 0.03, colour)
    assert table.count() == 2


def test_a_spoons_bowl_makes_no_vessel_of_the_cloth_under_it(table: Table) -> None:
    table.box(0.0, 0.0, 0.16, 0.16, 0.004, WHITE)
    table.ring(0.0, 0.018, 0.007, GREY)
    table.ring(0.018, 0.024, 0.014, GREY)
    table.box(0.064, 0.0, 0.08, 0.016, 0.014, GREY)  # its handle reaches over the hem
    assert table.count() == 2


def test_a_block_on_a_larger_one_is_two_though_only_corners_of_that_are_seen(table: Table) -> None:
    table.box(0.0, 0.0, 0.04, 0.04, 0.04, YELLOW)
    diamond = abs(table.x) + abs(table.y) < 0.0285  # over the edges of the lower one
    table.put(diamond, 0.07, GREEN)
    corners = table.labels == 1
    for number, quadrant in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        mine = corners & (table.x * quadrant[0] > 0) & (table.y * quadrant[1] > 0)
        table.labels[mine] = 3 + number
    assert table.count() == 2


def test_two_of_one_colour_on_either_side_of_a_taller_one_are_three(table: Table) -> None:
    table.box(-0.035, 0.0, 0.04, 0.03, 0.03, RED)
    table.box(0.0, 0.0, 0.03, 0.03, 0.06, BLUE)
    table.box(0.035, 0.0, 0.04, 0.03, 0.03, RED)
    assert table.count() == 3


# Splitting, and what rests on what ------------------------------------------------------------------------------------


def test_every_cell_of_a_thing_gets_a_region_thin_stripes_too(table: Table) -> None:
    table.box(0.0, 0.0, 0.1, 0.1, 0.004, WHITE)
    for x in (-0.03, 0.03):
        table.rgb[abs(table.x - x) < 0.003] = RED
    table.rgb[table.labels == 0] = 0
    labels = split_regions(table.grid)
    np.testing.assert_array_equal(labels > 0, table.grid.occupied)


def test_an_edge_in_height_or_colour_divides(table: Table) -> None:
    table.box(0.0, 0.0, 0.06, 0.04, 0.03, RED)
    table.box(0.0, 0.03, 0.06, 0.02, 0.03, BLUE)
    table.box(-0.02, -0.03, 0.02, 0.02, 0.05, RED)
    labels = split_regions(table.grid)
    of = [np.bincount(labels[table.labels == label]).argmax() for label in (1, 2, 3)]
    assert len(set(of)) == 3


def test_a_region_inside_a_lower_one_rests_on_it(table: Table) -> None:
    plate = table.ring(0.0, 0.06, 0.01, WHITE)
    egg = table.ring(0.0, 0.02, 0.05, YELLOW)
    beside = table.box(0.0, 0.085, 0.03, 0.03, 0.03, RED)
    supports = find_supports(table.labels, table.grid)
    assert supports[egg] == (pytest.approx(0.01), plate)
    assert supports[plate] == (0.0, 0)
    assert supports[beside] == (0.0, 0)


def test_a_region_inside_a_higher_one_stands_on_the_table(table: Table) -> None:
    table.ring(0.02, 0.05, 0.03, WHITE)
    hollow = table.ring(0.0, 0.02, 0.005, WHITE)
    assert find_supports(table.labels, table.grid)[hollow] == (0.0, 0)
