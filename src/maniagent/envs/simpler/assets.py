"""What SimplerEnv needs on a machine, and whether it is there; ManiSkill itself isn't imported for that."""

from __future__ import annotations

import importlib.metadata
import os
from pathlib import Path

from ...errors import SetupError

EXTRA = "pip install 'maniagent[simpler]'"
SETUP = "maniagent simpler setup"
_TASKS, _ROBOT = "tasks/bridge_v2_real2sim_dataset", "robots/widowx"
DOWNLOADS = {"bridge_v2_real2sim": _TASKS, "widowx250s": _ROBOT}
"""Names under which ManiSkill's downloader knows the assets, and the folders into which it puts them."""
_MODELS = (
    "baked_green_cube_3cm",
    "baked_yellow_cube_3cm",
    "bridge_carrot_generated_modified",
    "bridge_plate_objaverse_larger",
    "bridge_spoon_generated_modified",
    "dummy_sink_target_plane",
    "eggplant",
    "sink",
    "table_cloth_generated_shorter",
)
_PATTERNS = (
    f"{_TASKS}/custom/info_bridge_custom_v0.json",
    f"{_TASKS}/custom/info_bridge_custom_baked_tex_v0.json",
    *(f"{_TASKS}/custom/models/{model}/collision.obj" for model in _MODELS),
    *(f"{_TASKS}/custom/models/{model}/textured.*" for model in _MODELS),
    f"{_TASKS}/real_inpainting/bridge_real_eval_1.png",
    f"{_TASKS}/real_inpainting/bridge_sink.png",
    f"{_TASKS}/stages/bridge_table_1_v1.glb",
    f"{_TASKS}/stages/bridge_table_1_v2.glb",
    f"{_ROBOT}/wx250s.urdf",
    f"{_ROBOT}/wx250s.srdf",  # without it the fingers collide with the gripper's bar and never close
    f"{_ROBOT}/meshes_wx250s/*.stl",
)


def asset_root() -> Path:
    """The folder that ManiSkill reads: MS_ASSET_DIR, else ~/.maniskill."""
    return Path(os.environ.get("MS_ASSET_DIR") or Path.home() / ".maniskill")


def missing_packages() -> tuple[str, ...]:
    """The packages of the extra that are not installed."""
    return tuple(name for name in ("mani-skill", "sapien", "torch") if not _installed(name))


def missing_files(root: Path) -> tuple[str, ...]:
    """What the four tasks read and isn't below `root`/data; names relative to that, some with an asterisk."""
    data = root / "data"
    return tuple(pattern for pattern in _PATTERNS if not any(data.glob(pattern)))


def require() -> None:
    """Raise SetupError, with the line that mends it, where a package or an asset is missing.

    Whether anything renders is known only when it is tried.
    """
    if packages := missing_packages():
        raise SetupError(f"SimplerEnv needs {', '.join(packages)}, not installed here. Run: {EXTRA}")
    root = asset_root()
    if files := missing_files(root):
        raise SetupError(
            f"SimplerEnv's assets are not in {root} ({len(files)} of {len(_PATTERNS)} missing, {files[0]} first). "
            f"Run: {SETUP} --assets {root}, or set MS_ASSET_DIR to where they are."
        )


def _installed(name: str) -> bool:
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True
