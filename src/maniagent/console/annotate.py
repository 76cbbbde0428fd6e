"""Pictures for people: detections and grasps drawn onto a view, depth in colours."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ..geometry import FloatArray, project, transform_points
from ..types import CameraFrame, Detection, GraspPose, ObjectInfo

PALETTE = (
    (59, 130, 246),
    (245, 158, 11),
    (16, 185, 129),
    (236, 72, 153),
    (139, 92, 246),
    (20, 184, 166),
    (244, 63, 94),
    (132, 204, 22),
)
"""RGB colours that tell objects apart on a wooden table, in the order of the objects' indices."""

DEPTH_RANGE = (0.3, 1.5)
"""m, near and far end of the colour scale: a table-top camera's working range."""

_FINGER_LENGTH = 0.04
"""m, how long a finger is drawn."""

Picture = NDArray[np.uint8]


def colour_depth(depth: NDArray[np.float32], limits: tuple[float, float] = DEPTH_RANGE) -> Picture:
    """(H, W, 3) RGB of a depth image (H, W) in metres: near is warm, far is cold, unknown (NaN) is black."""
    near, far = limits
    known = np.isfinite(depth)
    scaled = np.clip((far - np.where(known, depth, far)) / (far - near), 0.0, 1.0)
    colours = cv2.applyColorMap((scaled * 255).astype(np.uint8), cv2.COLORMAP_TURBO)[..., ::-1]
    return np.where(known[..., None], colours, 0).astype(np.uint8)


def draw_detections(frame: CameraFrame, detections: Sequence[Detection], objects: Sequence[ObjectInfo] = ()) -> Picture:
    """(H, W, 3) RGB: the frame with masks tinted, boxes and names, and each object's best grasp as a small jaw.

    Detections of other frames are left out. The n-th query has the n-th colour, and so have its grasps.
    """
    picture = np.array(frame.rgb)
    seen = [d for d in detections if d.frame == frame.name]
    colours = {query: PALETTE[i % len(PALETTE)] for i, query in enumerate(dict.fromkeys(d.query for d in seen))}
    for detection in seen:
        _tint(picture, detection, colours[detection.query])
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    for detection in seen:
        draw.rectangle(detection.box, outline=colours[detection.query], width=2)
    for thing in objects:
        if thing.grasp is not None:
            _draw_jaw(draw, frame, thing.grasp)
    for detection in seen:  # last, so that nothing hides a name
        _draw_name(draw, detection, colours[detection.query], image.size)
    return np.asarray(image)


def _tint(picture: Picture, detection: Detection, colour: tuple[int, int, int]) -> None:
    mask = detection.mask
    if mask is None or mask.shape != picture.shape[:2]:
        return
    picture[mask] = (0.72 * picture[mask] + 0.28 * np.array(colour)).astype(np.uint8)
    outline, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outline, -1, colour, 1)


def jaw_segments(grasp: GraspPose) -> FloatArray:
    """(4, 2, 3) m, base frame: wrist stub, palm and the two fingers of a jaw at `grasp`, each as a line."""
    half = grasp.opening / 2
    back = -_FINGER_LENGTH
    lines = np.array(
        [
            [(2 * back, 0, 0), (back, 0, 0)],
            [(back, -half, 0), (back, half, 0)],
            [(back, -half, 0), (0, -half, 0)],
            [(back, half, 0), (0, half, 0)],
        ]
    )
    return transform_points(grasp.T_base_grasp, lines)


def _draw_jaw(draw: ImageDraw.ImageDraw, frame: CameraFrame, grasp: GraspPose) -> None:
    points = transform_points(frame.T_camera_base, jaw_segments(grasp))
    if not np.isfinite(points).all() or points[..., 2].min() < 0.05:  # at or behind the lens
        return
    for width, colour in ((5, (10, 12, 16)), (2, (255, 255, 255))):
        for line in project(frame.K, points):
            draw.line([tuple(end) for end in line.tolist()], fill=colour, width=width)


def _draw_name(
    draw: ImageDraw.ImageDraw, detection: Detection, colour: tuple[int, int, int], size: tuple[int, int]
) -> None:
    font = ImageFont.load_default(14)
    text = f"{detection.query[:40]}  {detection.score:.2f}"
    width = draw.textlength(text, font=font) + 10
    x = float(np.clip(detection.box[0], 0, max(0.0, size[0] - width)))
    below = detection.box[3] + 2  # under the object: grasps come from above
    y = below if below <= size[1] - 20 else max(0.0, detection.box[1] - 21)
    draw.rectangle((x, y, x + width, y + 19), fill=colour)
    dark = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 140
    draw.text((x + 5, y + 2), text, font=font, fill=(15, 17, 21) if dark else (255, 255, 255))
