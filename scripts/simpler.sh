#!/usr/bin/env bash
# Usage: scripts/simpler.sh PYTHON. Where SimplerEnv's assets are on this machine, sees to it that its tests can run:
# the extra `simpler` and a Vulkan renderer. Whatever can't be had is said, and those tests are skipped, no others.
set -uo pipefail
python=$1
newest_too_old=24 # Mesa's lavapipe up to that version is refused by SAPIEN

skip() {
    echo "SimplerEnv's tests will be skipped: $1"
    exit 0
}

export MS_ASSET_DIR=${MS_ASSET_DIR:-$PWD/../shared/simplerenv-assets}
[ -d "$MS_ASSET_DIR" ] || skip "its assets are not here (maniagent simpler setup fetches them)."

if ! "$python" -c 'import mani_skill' 2>/dev/null; then
    echo "SimplerEnv's assets are here: installing the extra simpler."
    # A torch of its own choosing would bring gigabytes of CUDA where a CPU build is at hand.
    "$python" -m pip install --quiet --disable-pip-version-check torch==2.13.0 &&
        "$python" -m pip install --quiet --disable-pip-version-check --editable '.[simpler]' ||
        skip "the extra could not be installed."
fi

install_lavapipe() {
    local backports=/etc/apt/sources.list.d/maniagent-backports.list source
    export DEBIAN_FRONTEND=noninteractive
    # shellcheck source=/dev/null
    . /etc/os-release
    apt-get update -qq
    if [ "$(apt-cache policy mesa-vulkan-drivers | sed -nE 's/ +Candidate: ([0-9]+).*/\1/p')" -gt "$newest_too_old" ]; then
        apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1 >/dev/null
        return
    fi
    # The mirror this machine uses already has the backports.
    source=$(apt-get indextargets --format '$(SITE)' "Created-By: Packages" "Codename: $VERSION_CODENAME" | head -1)
    [ -n "$source" ] || return 1
    echo "deb $source $VERSION_CODENAME-backports main" >"$backports"
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends -t "$VERSION_CODENAME-backports" mesa-vulkan-drivers libvulkan1 >/dev/null
}

try() {
    "$python" -m maniagent.cli simpler setup --no-download 2>&1
}

said=$(try) && exit 0
if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
    echo "Nothing renders SimplerEnv here: installing Mesa's software renderer for Vulkan."
    install_lavapipe && said=$(try) && exit 0
fi
skip "$said"
