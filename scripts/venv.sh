#!/usr/bin/env bash
# Usage: scripts/venv.sh FOLDER. Makes a virtual environment there with a Python that is new enough.
set -euo pipefail
folder=$1

as_root() { [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; }

find_python() {
    local name
    for name in ${PYTHON:-} python3.13 python3.12 python3.11 python3 python; do
        if command -v "$name" >/dev/null &&
            "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$name"
            return
        fi
    done
    return 1
}

if ! python=$(find_python); then
    if as_root; then
        echo "No Python 3.11 or newer: installing Debian's."
        export DEBIAN_FRONTEND=noninteractive
        apt-get update -qq
        apt-get install -y -qq --no-install-recommends python3 python3-venv >/dev/null
    fi
    if ! python=$(find_python); then
        echo "maniagent needs Python 3.11 or newer. Install one (on Debian 12, Ubuntu 24.04 and later:" >&2
        echo "  sudo apt-get install -y python3 python3-venv" >&2
        echo "), or name yours: make demo PYTHON=/path/to/python3.12" >&2
        exit 2
    fi
fi

# Debian splits ensurepip off into a package of its own, named after the version.
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    package="$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
    if as_root; then
        echo "Installing $package."
        export DEBIAN_FRONTEND=noninteractive
        apt-get update -qq
        apt-get install -y -qq --no-install-recommends "$package" >/dev/null
    else
        echo "Python's venv module is missing. Install it, then try again:" >&2
        echo "  sudo apt-get install -y $package" >&2
        exit 2
    fi
fi

"$python" -m venv "$folder"
