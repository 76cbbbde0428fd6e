"""What surrounds robot and objects in the twin: the table, the light, the backdrop and the cameras."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from .cameras import CameraSpec

TABLE_HALF_SIZE = (0.46, 0.56, 0.02)
TABLE_X = 0.26
"""m: the table reaches from behind the base to the camera's side; its top is z = 0."""
_OPENCV_TO_MUJOCO = np.diag([1.0, -1.0, -1.0])  # MuJoCo cameras look along -z with y up


def add_studio(spec: mujoco.MjSpec, cameras: Sequence[CameraSpec]) -> None:
    """Add table, lights, backdrop and cameras to a scene."""
    _add_table(spec)
    _add_light(spec)
    for camera in cameras:
        pose = camera.T_base_camera
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, (pose[:3, :3] @ _OPENCV_TO_MUJOCO).ravel())
        spec.worldbody.add_camera(name=camera.name, pos=pose[:3, 3], quat=quat, fovy=camera.fovy)
    spec.visual.global_.offwidth = max([camera.width for camera in cameras], default=640)
    spec.visual.global_.offheight = max([camera.height for camera in cameras], default=480)


def _add_table(spec: mujoco.MjSpec) -> None:
    # A faint grain: enough for a stereo camera (and a person) to see a surface, too little to look like objects.
    rng = np.random.default_rng(7)
    size = 256
    along = rng.normal(0.0, 1.0, (size, 8)).cumsum(axis=0)
    grain = np.repeat(along / np.abs(along).max(), size // 8, axis=1) * 3.0 + rng.normal(0.0, 1.5, (size, size))
    pixels = np.clip(np.array([172.0, 163.0, 151.0]) + grain[..., None], 0, 255).astype(np.uint8)
    texture = spec.add_texture(name="table", type=mujoco.mjtTexture.mjTEXTURE_2D, width=size, height=size, nchannel=3)
    texture.data = pixels.tobytes()
    material = spec.add_material(name="table", specular=0.05, shininess=0.1, texrepeat=[2, 2])
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture.name
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=TABLE_HALF_SIZE,
        pos=[TABLE_X, 0.0, -TABLE_HALF_SIZE[2]],
        material="table",
        friction=[0.7, 0.005, 0.0001],
        condim=4,
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4, 4, 0.1], pos=[0, 0, -0.7], rgba=[0.32, 0.34, 0.38, 1]
    )


def _add_light(spec: mujoco.MjSpec) -> None:
    spec.visual.headlight.ambient = [0.50, 0.50, 0.50]
    spec.visual.headlight.diffuse = [0.16, 0.16, 0.16]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    # Software rendering: a larger shadow map or multisampling doubles the cost of a picture. The cameras' own optics
    # (DepthNoise.colour) soften the edges instead.
    spec.visual.quality.shadowsize = 1024
    spec.visual.quality.offsamples = 0
    # The shadow map covers `extent` around `center`: kept to the table, it is fine enough not to stripe the objects.
    spec.stat.extent = 0.75
    spec.stat.center = [TABLE_X, 0.0, 0.05]
    spec.visual.map.znear = 0.02
    spec.visual.map.zfar = 8.0
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.62, 0.66, 0.72], rgb2=[0.30, 0.33, 0.38], width=64, height=384,
    )  # fmt: skip
    spec.worldbody.add_light(
        pos=[0.55, -0.35, 1.4], dir=[-0.22, 0.28, -1.0], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        diffuse=[0.42, 0.41, 0.39], specular=[0.12, 0.12, 0.12], castshadow=True,
    )  # fmt: skip
