#!/bin/sh
# Set up Evenlight in .venv beside this file: the system's Python with venv, then the packages of requirements/, each of
# which must have a SHA-256 that is recorded there.
#   ./setup.sh         what runs everything but sessions in a window; Python 3.11 to 3.14
#   ./setup.sh lab     and PsychoPy, with which sessions are run (Python 3.11 or 3.12); on Debian and Ubuntu also the
#                      libraries that it opens a window and a keyboard with, and a virtual screen to rehearse on
#   ./setup.sh docs    what builds the pages of docs/ as a site
#   ./setup.sh dev     and formatter, linter, type checker, and the Python packages that the tests need
#   ./setup.sh test    and a browser, the players and, where Python allows it, PsychoPy
# As root on Debian or Ubuntu it installs what the system lacks; elsewhere it says what is missing. PYTHON=/path/to/python
# before it names the Python to take.
set -eu
cd "$(dirname "$0")"
mode=${1:-}

LAB_PACKAGES="xvfb libgl1 libgl1-mesa-dri libglu1-mesa libegl1 libasound2 libjack-jackd2-0 libusb-1.0-0 libfribidi0"
LAB_PACKAGES="$LAB_PACKAGES libxtst6"  # with which the tests press keys
TEST_PACKAGES="g++ chromium chromium-driver mpv ffmpeg"
TEST_PACKAGES="$TEST_PACKAGES debootstrap"  # with which tests/headset builds the tree of its runtime
BUILD_LOG=.venv/pip.log

say() { echo "evenlight: $1"; }

stop() {
    echo "evenlight: $1" >&2
    exit 1
}

# fits PYTHON NEWEST: is it a Python from 3.11 to 3.NEWEST?
fits() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c "import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, $2))" 2>/dev/null
}

find_python() {
    for name in python3.12 python3.11 python3.13 python3.14 python3; do
        if fits "$name" "$newest"; then
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

# install_with_apt PACKAGES: what apt-get gives as the reason where it cannot is in $refusal, in parentheses.
refusal=
install_with_apt() {
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null 2>&1; then
        return 1
    fi
    say "asking apt-get for $1"
    # shellcheck disable=SC2086 # several packages are several words
    said=$({ apt-get update -qq &&
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $1; } 2>&1 >/dev/null) && return
    refusal=$(echo "$said" | sed -n '/^E: /{s// (apt-get: /;s/$/)/;p;q;}')
    return 1
}

packages_missing() {
    command -v dpkg-query >/dev/null 2>&1 || return 0
    for package in $1; do
        # Newer releases have libasound2t64 in its place, which says that it provides it.
        dpkg-query -W -f '${Status} ' "$package" "${package}t64" 2>/dev/null | grep -q 'ok installed' ||
            printf '%s ' "$package"
    done
}

pip_install() {
    # shellcheck disable=SC2086 # nothing, where it is empty
    .venv/bin/python -m pip install $quiet --disable-pip-version-check "$@" 2>>"$BUILD_LOG"
}

# install_packages NAMES: files of requirements/. The first has what builds packages without a wheel, and Evenlight: so
# nothing is fetched that has no hash there. Evenlight itself is a folder, which can have none.
install_packages() {
    quiet=--quiet
    [ ! -t 1 ] || quiet=  # its progress, where somebody looks
    : >"$BUILD_LOG"
    failed=
    for name in $1; do
        pip_install --require-hashes --no-build-isolation --use-pep517 --requirement "requirements/$name.txt" ||
            failed=1
        [ -z "$failed" ] || break
    done
    [ -n "$failed" ] || ! pip_install --no-deps --no-build-isolation --use-pep517 --editable . || return 0
    error=$(sed -n '/^ *ERROR: /{s///;p;q;}' "$BUILD_LOG")
    # A warning that it tries again is none that it failed. Where it finds nothing, it calls pins a conflict.
    if grep -v 'WARNING: ' "$BUILD_LOG" |
        grep -Eq 'from versions: none|ResolutionImpossible|Connection(Pool|Error)|Timeout'; then
        stop "packages could not be fetched${error:+ ($error)}: this needs a network, or PIP_INDEX_URL or PIP_FIND_LINKS for \
an index or a folder that can be reached and has them for $(.venv/bin/python --version) (what pip said: $BUILD_LOG); what is \
installed stays, run it again then"
    fi
    cat "$BUILD_LOG" >&2
    stop "pip could not install Evenlight${error:+: $error}; above is what it said"
}

newest=14 needs="Python 3.11 to 3.14" files="build base" packages='' marks=.ready
case "$mode" in
    '') ;;
    lab) newest=12 needs="Python 3.11 or 3.12 for PsychoPy" files="build base lab" packages=$LAB_PACKAGES marks=".ready .lab-ready" ;;
    test) files="build base docs dev lab" packages="$LAB_PACKAGES $TEST_PACKAGES" marks=".ready .docs-ready .dev-ready .test-ready" ;;
    docs) files="build base docs" marks=".ready .docs-ready" ;;
    dev) files="build base docs dev" marks=".ready .docs-ready .dev-ready" ;;
    *) stop "there is no mode $mode: leave it out, or say lab, test, docs or dev" ;;
esac

if [ -n "${PYTHON:-}" ]; then
    fits "$PYTHON" "$newest" || stop "PYTHON=$PYTHON is no Python 3.11 to 3.$newest; name one that is, or leave PYTHON out"
    python=$PYTHON
else
    python=$(find_python)
fi
for package in python3.12 python3.11 python3; do
    # The system's own Python, where it is too new or too old, does not become another by installing it.
    [ -z "$python" ] || break
    [ "$package" != python3 ] || ! command -v python3 >/dev/null 2>&1 || break
    install_with_apt "$package" || continue
    python=$(find_python)
done
[ -n "$python" ] || stop "needs $needs, and $(found)$refusal: install one beside it (for instance with \
'uv python install 3.12', pyenv or conda), then run 'make ${mode:-setup} PYTHON=/path/to/python3.12'"

venv_package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
"$python" -c 'import ensurepip, venv' 2>/dev/null || install_with_apt "$venv_package" ||
    stop "Python's venv is missing: install it ($venv_package on Debian and Ubuntu)$refusal, then run make again"

# What is made anew loses the marks of what was installed.
if [ -e .venv/.ready ] && ! .venv/bin/python -P -c 'import evenlight' 2>/dev/null; then
    say "the Python of .venv was replaced, or the folder moved: .venv is made anew"
    "$python" -m venv --clear .venv
elif [ -x .venv/bin/python ] && ! fits .venv/bin/python "$newest"; then
    [ -e .venv/.ready ] || stop "needs $needs, and .venv has another: remove the folder .venv, then run make again"
    say "needs $needs: .venv, which has another, is made anew"
    "$python" -m venv --clear .venv
elif [ ! -x .venv/bin/python ]; then
    say "making .venv with $("$python" --version)"
    "$python" -m venv --clear .venv
elif [ -n "${PYTHON:-}" ] && [ "$("$python" --version)" != "$(.venv/bin/python --version)" ]; then
    say "PYTHON is not used: .venv has $(.venv/bin/python --version); to change it, remove the folder .venv first"
fi
if [ "$mode" = test ] && fits .venv/bin/python 12; then
    marks="$marks .lab-ready"
elif [ "$mode" = test ]; then
    say "PsychoPy needs Python 3.11 or 3.12: the tests of sessions in a window will be skipped"
fi
missing=$(packages_missing "$packages")
[ -z "$missing" ] || install_with_apt "$missing" ||
    echo "evenlight: without $missing some windows, pages or players do not open here; as root: apt-get install $missing$refusal" >&2
say "installing its packages into .venv (a minute or a few, the first time)"
install_packages "$files"
say "compiling its loops (half a minute, the first time)"
.venv/bin/python -m evenlight.compile_kernels ||
    echo "evenlight: the loops were not compiled; the first command that needs them does it" >&2
for mark in $marks; do touch ".venv/$mark"; done
say "ready; start with '.venv/bin/evenlight demo --out demo', or type '. .venv/bin/activate' once and then 'evenlight'"
