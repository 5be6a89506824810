#!/bin/sh
# Runs a program of Python beside Monado, an OpenXR runtime with a simulated headset:
#   tests/headset/runtime-tree.sh .venv/bin/python -m pytest -n 0 tests/headset
# Monado needs a newer system than many have, so it runs in a tree of Debian 13 that is built where there is none
# (a minute or two, 0.8 GB) and kept. The checkout, its Python and the cache of scenes stand in it at their places; the
# folder /tmp is its own. Nothing stays mounted and no process goes on when this script ends, in whatever way.
# Exit code 77, and one line that says why, where there can be no such tree. XRT_COMPOSITOR_FORCE_XCB=1 before it shows
# what arrives in a window on the tree's own screen; EVENLIGHT_NO_TREE=1 leaves everything out.
set -eu
script=$(cd "$(dirname "$0")" && pwd)/runtime-tree.sh
root=${script%/tests/headset/*}
cache=${XDG_CACHE_HOME:-$HOME/.cache}
tree=$cache/evenlight-runtime-tree
PACKAGES=libopenxr1-monado,monado-service,mesa-vulkan-drivers,libegl1,libgl1,libgl1-mesa-dri,libglx-mesa0,xvfb
PACKAGES=$PACKAGES,libxcursor1,libxinerama1,libxrandr2,libxi6  # with which windows are opened
LIMIT=1200  # for all of it [s]
BUILD_LIMIT=400

without() {
    echo "evenlight: the tests in an OpenXR runtime are left out: $1" >&2
    exit 77
}

# The mirror of a Debian is the first that apt asks; elsewhere debootstrap knows one.
mirror() {
    grep -qx 'ID=debian' /etc/os-release 2>/dev/null || return 0
    cat /etc/apt/sources.list /etc/apt/sources.list.d/*.list /etc/apt/sources.list.d/*.sources 2>/dev/null |
        sed -nE 's/^(URIs:|deb)[[:space:]]+(\[[^]]*\][[:space:]]+)?(https?:[^[:space:]]+).*/\3/p' | head -n 1
}

build() {
    command -v debootstrap >/dev/null || without "debootstrap is missing (as root: apt-get install debootstrap)"
    echo "evenlight: building a tree of Debian 13 with Monado in $tree (a minute or two)" >&2
    rm -rf --one-file-system "$tree"
    # shellcheck disable=SC2046 # no word at all, where no mirror is known
    timeout "$BUILD_LIMIT" debootstrap --variant=minbase --include="$PACKAGES" trixie "$tree" $(mirror) \
        >"$tree.log" 2>&1 || without "debootstrap failed ($(tail -n 1 "$tree.log")); what it said is in $tree.log"
    rm -rf "$tree/var/cache/apt/archives" "$tree/var/lib/apt/lists"
    echo "$PACKAGES" >"$tree/packages"
}

bind() {
    if [ -d "$1" ]; then
        mkdir -p "$tree$1"
    else
        mkdir -p "$tree$(dirname "$1")" && touch "$tree$1"
    fi
    mount --bind "$1" "$tree$1"
}

# What a Python needs: of one that belongs to the system, its program and its library.
python_paths() {
    "$1" -c 'import os, sys, sysconfig
program = sys._base_executable
own = [program, os.path.realpath(program), sysconfig.get_path("stdlib")]
print(sys.prefix, *(own if sys.base_prefix == "/usr" else [sys.base_prefix]), sep="\n")'
}

in_namespace() {
    mkdir -p "$cache/evenlight"
    (
        flock 9
        [ "$(cat "$tree/packages" 2>/dev/null)" = "$PACKAGES" ] || build
    ) 9>"$tree.lock"
    mount -t proc proc "$tree/proc"
    mount -t tmpfs -o mode=1777 tmpfs "$tree/tmp"
    mount -t tmpfs -o mode=1777 tmpfs "$tree/dev/shm"
    python_paths "$1" | while read -r path; do bind "$path"; done
    bind "$cache/evenlight"
    bind "$root"
    chroot "$tree" "$1" -c 'import numpy' 2>/dev/null || without "$1 does not run on Debian 13"
    # A network of its own, for sockets of screens outside of the tree are in that.
    exec unshare --net chroot "$tree" /bin/sh "$script" in-tree "$@"
}

wait_for() {
    for _ in $(seq 300); do
        [ ! -S "$1" ] || return 0
        sleep 0.1
    done
    cat /tmp/Xvfb.log /tmp/monado.log >&2
    echo "evenlight: $1 did not come" >&2
    exit 1
}

in_tree() {
    cd "$root"
    export LANG=C.UTF-8 TMPDIR=/tmp DISPLAY=:77 EVENLIGHT_IN_RUNTIME_TREE=1
    export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    export XDG_RUNTIME_DIR=/tmp/runtime XR_RUNTIME_JSON=/usr/share/openxr/1/openxr_monado.json
    export SIMULATED_ENABLE=1 XRT_NO_STDIN=1  # for services that tests start, too
    [ -n "${XRT_COMPOSITOR_FORCE_XCB:-}" ] || export XRT_COMPOSITOR_NULL=1
    unset WAYLAND_DISPLAY XAUTHORITY
    mkdir -m 700 "$XDG_RUNTIME_DIR"
    Xvfb "$DISPLAY" -screen 0 1280x1024x24 -nolisten tcp >/tmp/Xvfb.log 2>&1 &
    wait_for /tmp/.X11-unix/X77
    sleep infinity | monado-service >/tmp/monado.log 2>&1 &  # it ends where its input does
    wait_for "$XDG_RUNTIME_DIR/monado_comp_ipc"
    "$@"  # this shell stays until then: where it ends, all processes of the tree do
}

case "${1:-}" in
    '') echo "usage: $0 PYTHON [ARGUMENT]..." >&2; exit 2 ;;
    in-namespace) shift; in_namespace "$@" ;;
    in-tree) shift; in_tree "$@" ;;
    *)
        # In the tree nothing is at a path from here: the Python is named from the root. It may be a link of a venv.
        python=$(command -v "$1") || { echo "evenlight: there is no $1 here" >&2; exit 2; }
        python=$(cd "$(dirname "$python")" && pwd -P)/$(basename "$python")
        shift
        set -- "$python" "$@"
        cd "$root"
        [ -z "${EVENLIGHT_NO_TREE:-}" ] || without "EVENLIGHT_NO_TREE is set"
        [ "$(id -u)" = 0 ] || without "building the tree for it needs root"
        said=$(unshare --mount --pid --fork true 2>&1) || without "nothing can be mounted here ($said)"
        # Each ends where the one before it does.
        exec timeout --foreground --signal=KILL "$LIMIT" setpriv --pdeathsig KILL \
            unshare --mount --pid --fork --kill-child /bin/sh "$script" in-namespace "$@"
        ;;
esac
