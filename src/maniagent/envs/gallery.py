"""A contact sheet of every object in the library, one captioned picture each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ..geometry import FloatArray, look_at
from .objects import ObjectModel, attach, make_object, object_names
from .offscreen import OffscreenRenderer

CAMERA = "gallery"
PARKED = 50.0
"""m, how far away the objects wait that are not being pictured."""
PAPER, INK, FAINT = (250, 249, 246), (38, 40, 44), (122, 124, 128)


@dataclass(frozen=True)
class _Placed:
    """One object in a picture."""

    model: ObjectModel
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """m, of the middle of its underside."""
    yaw: float = 0.45


@dataclass(frozen=True)
class _Exhibit:
    """One picture of the sheet."""

    title: str
    note: str
    placed: tuple[_Placed, ...]
    radius: float
    """m, of the ball about `centre` that the picture must show."""
    centre: tuple[float, float, float]


def render_gallery(path: Path, *, columns: int = 5, tile: tuple[int, int] = (400, 300)) -> Path:
    """Draw all objects, captioned with their names and sizes, into one PNG at `path`, and return `path`.

    `tile` is one picture's width and height in pixels. Folders are made as needed. Raises SetupError where nothing
    renders.
    """
    exhibits = _exhibits()
    model = _scene(exhibits, tile)
    renderer = OffscreenRenderer(model)
    try:
        pictures = [_picture(model, renderer, index, exhibits, tile) for index in range(len(exhibits))]
    finally:
        renderer.close()
    path.parent.mkdir(parents=True, exist_ok=True)
    _sheet(exhibits, pictures, columns, tile).save(path, format="PNG", optimize=True)
    return path


def _exhibits() -> list[_Exhibit]:
    """One exhibit for each kind of object, and one that shows blocks of several sizes and colours."""
    exhibits = []
    for kind in object_names():
        model = make_object(kind)
        length, width, height = (round(1000 * side) for side in model.extent)
        radius = float(np.hypot(model.radius, model.rest_z))
        note = f"{length} x {width} x {height} mm"
        exhibits.append(_Exhibit(model.title, note, (_Placed(model),), radius, (0.0, 0.0, model.rest_z)))
    blue, yellow = make_object("block", size=0.055, colour="blue"), make_object("block", size=0.03, colour="yellow")
    green, flat = make_object("block", colour="green"), make_object("block", size=(0.06, 0.03, 0.02), colour="natural")
    blocks = (
        _Placed(blue, (-0.025, 0.025, 0.0)),
        _Placed(yellow, (-0.025, 0.025, 0.055), 0.15),
        _Placed(green, (0.045, 0.010, 0.0), 0.1),
        _Placed(flat, (0.0, -0.050, 0.0), 0.25),
    )
    return [*exhibits, _Exhibit("blocks", "any size and colour", blocks, 0.088, (0.0, 0.0, 0.03))]


def _scene(exhibits: list[_Exhibit], tile: tuple[int, int]) -> mujoco.MjModel:
    """A bright table top with every object on it, somewhere."""
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient = [0.42, 0.42, 0.42]
    spec.visual.headlight.diffuse = [0.22, 0.22, 0.22]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    spec.visual.quality.shadowsize = 2048
    spec.visual.quality.offsamples = 8
    spec.visual.global_.offwidth, spec.visual.global_.offheight = tile
    spec.visual.map.znear = 0.02
    spec.stat.extent, spec.stat.center = 0.5, [0.0, 0.0, 0.0]
    spec.worldbody.add_light(
        pos=[-0.3, -0.3, 1.0],
        dir=[0.35, 0.3, -1.0],
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        diffuse=[0.40, 0.39, 0.37],
        specular=[0.25, 0.25, 0.25],
        castshadow=True,
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.1], rgba=[0.80, 0.78, 0.74, 1.0])
    spec.worldbody.add_camera(name=CAMERA, mode=mujoco.mjtCamLight.mjCAMLIGHT_FIXED, fovy=24.0)
    for index, exhibit in enumerate(exhibits):
        for place, placed in enumerate(exhibit.placed):
            attach(spec, placed.model, _body(index, place))
    return spec.compile()


def _body(exhibit: int, place: int) -> str:
    return f"exhibit{exhibit}.{place}"


def _picture(
    model: mujoco.MjModel, renderer: OffscreenRenderer, shown: int, exhibits: list[_Exhibit], tile: tuple[int, int]
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) of one exhibit; all others are out of sight."""
    data = mujoco.MjData(model)
    for index, exhibit in enumerate(exhibits):
        for place, placed in enumerate(exhibit.placed):
            x, y, z = placed.position
            away = 0.0 if index == shown else PARKED + index
            half = placed.yaw / 2
            pose = [x + away, y, z + placed.model.rest_z, np.cos(half), 0.0, 0.0, np.sin(half)]
            data.joint(_body(index, place)).qpos[:] = pose
    _aim(model, exhibits[shown])
    mujoco.mj_forward(model, data)
    rgb, _ = renderer.render(data, CAMERA, *tile, depth=False)
    return rgb


def _aim(model: mujoco.MjModel, exhibit: _Exhibit) -> None:
    """Point the camera at the exhibit from the front and above, as far away as it must be to show all of it."""
    camera = model.camera(CAMERA)
    distance = 1.1 * exhibit.radius / np.sin(np.radians(float(camera.fovy[0])) / 2)
    target = np.array(exhibit.centre)
    direction: FloatArray = np.array([0.0, -np.cos(np.radians(42.0)), np.sin(np.radians(42.0))])
    T_world_camera = look_at(target + distance * direction, target)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, (T_world_camera[:3, :3] @ np.diag([1.0, -1.0, -1.0])).ravel())  # MuJoCo looks along -z
    camera.pos[:], camera.quat[:] = T_world_camera[:3, 3], quat


def _sheet(
    exhibits: list[_Exhibit], pictures: list[NDArray[np.uint8]], columns: int, tile: tuple[int, int]
) -> Image.Image:
    """All pictures in rows with their captions beneath."""
    width, height = tile
    gap, caption, head = width // 20, height // 5, height // 3
    rows = -(-len(exhibits) // columns)
    sheet = Image.new(
        "RGB", (columns * (width + gap) + gap, head + rows * (height + caption + gap) + gap // 2), color=PAPER
    )
    draw = ImageDraw.Draw(sheet)
    draw.text(
        (gap, head // 2), "Objects of the tabletop", fill=INK, font=ImageFont.load_default(height / 7), anchor="lm"
    )
    big, small = ImageFont.load_default(height / 15), ImageFont.load_default(height / 20)
    for index, (exhibit, picture) in enumerate(zip(exhibits, pictures, strict=True)):
        x = gap + (index % columns) * (width + gap)
        y = head + (index // columns) * (height + caption + gap)
        mask = Image.new("L", tile, 0)
        ImageDraw.Draw(mask).rounded_rectangle((0, 0, width - 1, height - 1), radius=gap // 2, fill=255)
        sheet.paste(Image.fromarray(picture), (x, y), mask)
        draw.text((x + 2, y + height + caption * 0.33), exhibit.title, fill=INK, font=big, anchor="lm")
        draw.text((x + 2, y + height + caption * 0.74), exhibit.note, fill=FAINT, font=small, anchor="lm")
    return sheet
