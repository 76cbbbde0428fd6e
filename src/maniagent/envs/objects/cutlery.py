"""Spoon, fork, knife. They lie on z = 0, handle towards -x, as `assemble` wants it; metres."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh, lathe, merge, prism, sweep
from .model import Finish, ObjectModel, Visual, assemble
from .pieces import Contact, Piece, box_piece, ellipsoid_piece

CUTLERY = Contact(sliding=0.6, torsional=0.006, rolling=0.0002)
STEEL = Finish((0.66, 0.68, 0.72), specular=0.9, shininess=0.7)


def spoon() -> ObjectModel:
    """A steel table spoon, bowl towards +x."""
    bowl_x, length, width = 0.0530, 0.044, 0.035
    outline = [
        (0, 0),
        (0.5, 0.0005),
        (0.82, 0.0028),
        (1, 0.0066),
        (0.97, 0.0076),
        (0.9, 0.0072),
        (0.74, 0.0044),
        (0.45, 0.0026),
        (0, 0.0022),
    ]
    bowl = lathe(outline, sides=28, oval=(length / 2, width / 2)).shifted((bowl_x, 0, 0))
    return assemble(
        "spoon",
        "spoon",
        [Visual(merge([_handle(0.018, 0.034), bowl]), STEEL)],
        [*_handle_pieces(0.018, 0.034), ellipsoid_piece((length, width, 0.0054), (bowl_x, 0, 0.0027))],
        mass=0.035,
        contact=CUTLERY,
    )


def fork() -> ObjectModel:
    """A steel table fork with four tines towards +x."""
    thick, half, tine, start, root, tip = 0.0036, 0.0125, 0.0034, 0.022, 0.044, 0.075
    head = prism(
        [
            (start, -0.003),
            (0.027, -0.006),
            (0.034, -half),
            (root, -half),
            (root, half),
            (0.034, half),
            (0.027, 0.006),
            (start, 0.003),
        ],
        thick,
        0.0006,
    )
    x = np.array([root - 0.002, tip - 0.006, tip - 0.002, tip])
    tines = [
        sweep(
            np.column_stack([x, np.full(4, y), np.full(4, thick / 2)]),
            np.column_stack([np.array([tine, tine, 0.8 * tine, 0.3 * tine]) / 2, np.full(4, thick / 2)]),
            sides=8,
            squareness=4.0,
        )
        for y in np.linspace(-(half - tine / 2), half - tine / 2, 4)
    ]
    pieces = [
        *_handle_pieces(0.010, 0.030),
        box_piece((root - 0.032, 2 * half, thick), ((root + 0.032) / 2, 0, thick / 2)),
        box_piece((tip - root, 2 * half, thick), ((tip + root) / 2, 0, thick / 2)),
    ]
    return assemble(
        "fork",
        "fork",
        [Visual(merge([_handle(0.010, 0.030), head, *tines]), STEEL)],
        pieces,
        mass=0.040,
        contact=CUTLERY,
    )


def knife() -> ObjectModel:
    """A steel table knife, blade towards +x, its edge towards +y."""
    thick, spine, edge, start, tip = 0.0030, -0.0075, 0.0125, -0.004, 0.075
    belly = [(0.071, 0.0015), (0.065, 0.0065), (0.056, 0.0105), (0.045, edge), (0.010, edge), (0.004, 0.0105)]
    outline = [(start, -0.0055), (0.004, spine), (tip - 0.004, spine), (tip, -0.0055), *belly, (start, 0.0055)]
    pieces = [
        *_handle_pieces(-0.004, 0.002),
        box_piece((0.052, edge - spine, thick), (0.030, (edge + spine) / 2, thick / 2)),
        box_piece((0.018, 0.011, thick), (0.065, spine + 0.0055, thick / 2)),
    ]
    blade = prism(outline, thick, 0.0006)
    return assemble(
        "knife", "knife", [Visual(merge([_handle(-0.004, 0.002), blade]), STEEL)], pieces, mass=0.060, contact=CUTLERY
    )


def _handle(end: float, neck: float) -> Mesh:
    """A handle 12 mm wide and 8 mm thick from x = -75 mm to `end`, tapering to a neck at `neck`, m."""
    x = np.array([-0.0750, -0.0735, -0.0700, -0.0400, end - 0.012, end, neck])
    half_width = np.array([2.0, 4.4, 5.8, 6.0, 5.6, 4.2, 2.6]) / 1000
    half_height = np.array([1.5, 3.2, 4.0, 4.0, 4.0, 3.2, 2.0]) / 1000
    z = np.array([4.0, 4.0, 4.0, 4.0, 4.0, 3.4, 2.6]) / 1000
    return sweep(
        np.column_stack([x, np.zeros(7), z]), np.column_stack([half_width, half_height]), sides=16, squareness=3.0
    )


def _handle_pieces(end: float, neck: float) -> list[Piece]:
    """What is felt of `_handle`."""
    length = end - 0.004 + 0.0742
    return [
        box_piece((length, 0.0118, 0.008), (-0.0742 + length / 2, 0.0, 0.004)),
        box_piece((neck - end + 0.008, 0.006, 0.0048), ((neck + end) / 2, 0.0, 0.0024 + 0.0004)),
    ]
