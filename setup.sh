#!/bin/sh
# Set up Evenlight in .venv beside this file: the system's Python with venv, then the packages of constraints.txt.
# As root on Debian or Ubuntu it installs what the system lacks; elsewhere it says what is missing.
set -eu
cd "$(dirname "$0")"

find_python() {
    for name in "${PYTHON:-}" python3.12 python3.11 python3; do
        [ -n "$name" ] && command -v "$name" >/dev/null 2>&1 || continue
        "$name" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null || continue
        echo "$name"
        return
    done
}

install_with_apt() {
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null 2>&1; then
        echo "evenlight: $1 is missing: install it ($2 on Debian and Ubuntu), then run make again" >&2
        exit 1
    fi
    echo "installing $2"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$2" >/dev/null
}

python=$(find_python)
if [ -z "$python" ]; then
    install_with_apt "Python 3.11 or 3.12" python3
    python=$(find_python)
    [ -n "$python" ] || { echo "evenlight: needs Python 3.11 or 3.12; name one with PYTHON=..." >&2; exit 1; }
fi
"$python" -c 'import ensurepip, venv' 2>/dev/null || install_with_apt "Python's venv" python3-venv

[ -x .venv/bin/python ] || "$python" -m venv .venv
echo "installing Evenlight into .venv (some minutes the first time)"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
touch .venv/.ready
