"""How an object gets into a MuJoCo scene."""

from __future__ import annotations

import mujoco
import numpy as np

from .model import ObjectModel, Visual
from .pieces import Piece

VISUAL_GROUP = 1
COLLISION_GROUP = 3
"""Geom groups: cameras draw groups 0 to 2, so collision pieces stay unseen."""

SOLREF = (0.005, 1.0)
"""Time constant (s) and damping ratio of contacts: stiff, because a light thin thing (a fork's tines) that lands
must not sink through half its thickness, beyond which it would be pushed out on the wrong side."""
SOLMIX = 50.0
"""Weight of `SOLREF` against the softer default of a table."""


def attach(spec: mujoco.MjSpec, model: ObjectModel, name: str) -> None:
    """Add `model` to the scene as a body `name` with a free joint `name`, upright at rest on z = 0, x and y 0.

    Names of meshes, textures and materials begin with `name/`, so one scene can hold many of a kind.
    """
    body = spec.worldbody.add_body(name=name, pos=[0.0, 0.0, model.rest_z])
    body.add_freejoint(name=name)
    for index, visual in enumerate(model.visuals):
        _add_visual(spec, body, visual, f"{name}/{index}")
    total_volume = sum(piece.volume for piece in model.pieces)
    for index, piece in enumerate(model.pieces):
        _add_piece(body, piece, model, mass=model.mass * piece.volume / total_volume, name=f"{name}/piece{index}")


def _add_visual(spec: mujoco.MjSpec, body: mujoco.MjsBody, visual: Visual, name: str) -> None:
    mesh, finish = visual.mesh, visual.finish
    vertices, normals, faces = mesh.with_normals  # MuJoCo 4.0 overlooks `userfacenormal`: one normal a vertex
    spec.add_mesh(
        name=name,
        uservert=vertices.ravel(),
        usernormal=normals.ravel(),
        userface=faces.ravel(),
        usertexcoord=mesh.uv.ravel(),
        userfacetexcoord=np.arange(faces.size),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,  # parts are thin, and weigh nothing here
    )
    material = spec.add_material(
        name=name, rgba=[*finish.colour, 1.0], specular=finish.specular, shininess=finish.shininess
    )
    if finish.texture is not None:
        height, width, _ = finish.texture.shape
        texture = spec.add_texture(
            name=name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            width=width,
            height=height,
            nchannel=3,
        )
        texture.data = finish.texture.tobytes()
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=name,
        group=VISUAL_GROUP,
        contype=0,
        conaffinity=0,
        mass=0.0,
    )


def _add_piece(body: mujoco.MjsBody, piece: Piece, model: ObjectModel, mass: float, name: str) -> None:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, piece.rotation.ravel())
    contact = piece.contact or model.contact
    body.add_geom(
        name=name,
        type=piece.shape,
        size=piece.size,
        pos=piece.centre,
        quat=quaternion,
        group=COLLISION_GROUP,
        mass=mass,
        condim=6,
        friction=[contact.sliding, contact.torsional, contact.rolling],
        priority=contact.priority,
        solref=SOLREF,
        solmix=SOLMIX,
    )
