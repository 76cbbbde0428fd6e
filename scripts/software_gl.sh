#!/usr/bin/env bash
# Usage: scripts/software_gl.sh PYTHON. Sees to it that camera images can be drawn: where nothing draws it installs
# Mesa's software renderer when it may, else says the line that does.
set -euo pipefail
python=$1

ask() {
    "$python" - <<'PY'
import sys

from maniagent.envs.rendering import ensure_gl
from maniagent.errors import SetupError

try:
    print("Camera images are drawn by", ensure_gl())
except SetupError as error:
    sys.exit(f"{error}")
PY
}

if reason=$(ask 2>&1); then
    echo "$reason"
    exit 0
fi
if [ -n "${MUJOCO_GL:-}" ] || [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null; then
    echo "$reason" >&2
    exit 2
fi
echo "Nothing draws camera images here: installing Mesa's software renderer."
export DEBIAN_FRONTEND=noninteractive
packages=$("$python" -c 'from maniagent.envs.rendering import PACKAGES; print(*PACKAGES["egl"])')
apt-get update -qq
# shellcheck disable=SC2086  # one word a package
apt-get install -y -qq --no-install-recommends $packages >/dev/null
ask
