#!/bin/sh
# Set up Evenlight in .venv beside this file: the system's Python with venv, then the packages of constraints.txt.
# `./setup.sh lab` adds PsychoPy, with which sessions are run, and on Debian and Ubuntu the libraries that it opens a
# window and a keyboard with, and a virtual screen to rehearse on. `./setup.sh test` adds to that the browser and
# the players that the tests try pages and videos with.
# As root on Debian or Ubuntu it installs what the system lacks; elsewhere it says what is missing.
set -eu
cd "$(dirname "$0")"

LAB_PACKAGES="xvfb libgl1 libgl1-mesa-dri libglu1-mesa libegl1 libasound2 libjack-jackd2-0 libusb-1.0-0 libfribidi0"
LAB_PACKAGES="$LAB_PACKAGES libxtst6"  # with which the tests press keys
TEST_PACKAGES="chromium chromium-driver mpv ffmpeg"

stop() {
    echo "evenlight: $1" >&2
    exit 1
}

fits() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null
}

find_python() {
    for name in python3.12 python3.11 python3; do
        if fits "$name"; then
            echo "$name"
            return
        fi
    done
}

found() {
    if command -v python3 >/dev/null 2>&1; then
        echo "python3 here is $(python3 --version 2>&1 || echo broken)"
    else
        echo "there is no python3 here"
    fi
}

install_with_apt() {
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null 2>&1; then
        return 1
    fi
    echo "installing $1"
    apt-get update -qq || return 1
    # shellcheck disable=SC2086 # several packages are several words
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $1 >/dev/null || return 1
}

packages_missing() {
    command -v dpkg-query >/dev/null 2>&1 || return 0
    for package in $1; do
        # Newer releases have libasound2t64 in its place, which says that it provides it.
        dpkg-query -W -f '${Status} ' "$package" "${package}t64" 2>/dev/null | grep -q 'ok installed' ||
            printf '%s ' "$package"
    done
}

if [ -n "${PYTHON:-}" ]; then
    fits "$PYTHON" || stop "PYTHON=$PYTHON is no Python 3.11 or 3.12; name one that is, or leave PYTHON out"
    python=$PYTHON
else
    python=$(find_python)
fi
for package in python3.12 python3.11 python3; do
    # The system's own Python, where it is too new or too old, does not become another by installing it.
    [ -z "$python" ] || break
    [ "$package" != python3 ] || ! command -v python3 >/dev/null 2>&1 || break
    install_with_apt "$package" 2>/dev/null || continue
    python=$(find_python)
done
[ -n "$python" ] || stop "needs Python 3.11 or 3.12, and $(found): install one beside it (for instance with \
'uv python install 3.12' or pyenv), then run make again with PYTHON=/path/to/python3.12 before it"

venv_package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
"$python" -c 'import ensurepip, venv' 2>/dev/null || install_with_apt "$venv_package" ||
    stop "Python's venv is missing: install it ($venv_package on Debian and Ubuntu), then run make again"

[ -x .venv/bin/python ] || "$python" -m venv .venv
fits .venv/bin/python || stop "the Python in .venv is not 3.11 or 3.12: remove the folder .venv, then run make again"
extras=dev
packages=
case "${1:-}" in
    lab) extras=dev,lab packages=$LAB_PACKAGES ;;
    test) extras=dev,lab packages="$LAB_PACKAGES $TEST_PACKAGES" ;;
esac
missing=$(packages_missing "$packages")
[ -z "$missing" ] || install_with_apt "$missing" ||
    echo "evenlight: without $missing some windows, pages or players do not open here; as root: apt-get install $missing" >&2
echo "installing Evenlight into .venv (some minutes the first time)"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 --constraint constraints.txt --editable ".[$extras]"
echo "compiling its loops (half a minute the first time)"
.venv/bin/python -m evenlight.compile_kernels ||
    echo "evenlight: the loops were not compiled; the first command that needs them does it" >&2
touch .venv/.ready
[ "$extras" = dev ] || touch .venv/.lab-ready
[ "${1:-}" != test ] || touch .venv/.test-ready
