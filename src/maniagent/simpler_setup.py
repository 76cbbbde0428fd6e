"""Makes SimplerEnv work on this machine: what is there, what is missing, the download, and a real trial."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from .doctor import Check
from .envs.simpler.assets import DOWNLOADS, EXTRA, asset_root, missing_files, missing_packages
from .errors import SetupError

_DOWNLOADER = "mani_skill.utils.download_asset"
_TRIAL_LIMIT = 180.0
"""s; the first picture of a fresh driver takes some ten seconds."""
_RENDERER = (
    "install a Vulkan driver: that of your GPU, or Mesa's lavapipe 25 or newer (Debian: apt-get install "
    "mesa-vulkan-drivers, on bookworm from backports); where there are several, VK_ICD_FILENAMES names one's json"
)


def examine(assets: Path | None = None, download: bool = True) -> tuple[Check, ...]:
    """Look at packages, assets and renderer, in this order, up to the first that is missing.

    Assets are looked for in `assets` (else MS_ASSET_DIR, else ManiSkill's default) and, with `download`, fetched by
    ManiSkill's own downloader where they are not there. Raises SetupError where that fails.
    """
    root = (assets or asset_root()).expanduser().resolve()
    checks = [_packages()]
    if checks[-1].ok:
        if download:
            _fetch(root)
        checks.append(_assets(root))
    if checks[-1].ok:
        checks.append(_trial(root))
    return tuple(checks)


def _packages() -> Check:
    missing = missing_packages()
    detail = f"missing: {', '.join(missing)}" if missing else "mani-skill, sapien, torch"
    return Check("packages", not missing, detail, EXTRA if missing else "")


def _assets(root: Path) -> Check:
    missing = missing_files(root)
    if not missing:
        told = str(root) if root == asset_root().resolve() else f"{root}; set MS_ASSET_DIR={root} from now on"
        return Check("assets", True, told)
    shown = ", ".join(missing[:3]) + (f" and {len(missing) - 3} more" if len(missing) > 3 else "")
    return Check("assets", False, f"missing in {root / 'data'}: {shown}", f"maniagent simpler setup --assets {root}")


def _fetch(root: Path) -> None:
    missing = missing_files(root)
    for name, folder in DOWNLOADS.items():
        if not any(file.startswith(folder) for file in missing):
            continue
        target = root / "data" / folder
        if target.is_dir() and any(target.iterdir()):
            # ManiSkill's downloader would delete what is there before it knows that it can fetch the rest.
            raise SetupError(f"{target} is there but not complete. Move it away, then run this again.")
        _download(name, root)


def _download(name: str, root: Path) -> None:
    command = [sys.executable, "-m", _DOWNLOADER, name, "--quiet", "--non-interactive"]
    done = subprocess.run(  # noqa: S603 - our own command
        command, env=_environment(root), capture_output=True, text=True, check=False
    )
    if done.returncode:
        why = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        raise SetupError(
            f"ManiSkill could not download {name!r}: {why[0]} Fetch it where the network is open "
            f"(python -m {_DOWNLOADER} {name}), copy it, and run this with --assets."
        )


def _trial(root: Path) -> Check:
    """A picture and a step in another process."""
    command = [sys.executable, "-m", "maniagent.envs.simpler.trial"]
    try:
        done = subprocess.run(  # noqa: S603 - our own command
            command, env=_environment(root), capture_output=True, text=True, check=False, timeout=_TRIAL_LIMIT
        )
        told = json.loads(done.stdout.strip().splitlines()[-1])
    except subprocess.TimeoutExpired:
        return Check("trial", False, f"no picture within {_TRIAL_LIMIT:.0f} s", _RENDERER)
    except (IndexError, ValueError):
        return Check("trial", False, f"the trial ended with status {done.returncode}", _RENDERER)
    if "error" in told:
        return Check("trial", False, str(told["error"]), _RENDERER)
    return Check("trial", True, f"{told['renderer']}: a picture and a step in {told['seconds']} s, start included")


def _environment(root: Path) -> dict[str, str]:
    return {**os.environ, "MS_ASSET_DIR": str(root), "MS_SKIP_ASSET_DOWNLOAD_PROMPT": "1"}
