#!/bin/sh
# Is uavrt the same on 64-bit ARM? `deploy/try-arm64.sh [DIRECTORY]`, or `make try-arm64`
#
# Makes a Debian root for 64-bit ARM, runs it by an emulator (enter.sh: no root rights needed,
# nothing of this machine is touched), installs uavrt there with deploy/install.sh as on a
# Raspberry Pi, and compares it with this machine (arm64/checks.py): doctor, pulses of a
# recording, the processes killed and restarted in a flight, the page. Needs the package servers
# of Debian and PyPI and the uavrt of this source (`make setup`); takes ten to twenty minutes,
# mostly in the emulator, and 3 GB. With DIRECTORY everything is kept there, and the next run
# begins with what is there; otherwise it is removed at the end.
set -eu

source=$(cd "$(dirname "$0")/.." && pwd)
python=${PYTHON:-$source/.venv/bin/python}
if [ $# -gt 0 ]; then
    mkdir -p "$1"
    work=$(cd "$1" && pwd)
else
    work=$(mktemp -d)
    trap 'rm -rf --one-file-system "$work"' EXIT
    trap 'exit 130' INT TERM
fi
say() { printf '%s\n' "try-arm64: $*"; }

"$source/deploy/arm64/make-root.sh" "$work"
code=0
said=$("$source/deploy/arm64/enter.sh" "$work" uname -m 2>&1) || code=$?
if [ "$code" = 3 ] || [ "$said" != aarch64 ]; then
    say "skipped: emulation is not possible here: $said"
    exit 77
fi
say "a root for $said, by $("$work/qemu-aarch64-static" --version | head -1)"

wheels=$work/wheels
if [ ! -e "$wheels/.complete" ]; then
    mkdir -p "$wheels"
    fetch() {
        "$python" -m pip download -qq --disable-pip-version-check --only-binary=:all: \
            --dest "$wheels" --implementation cp --python-version 3.11 --abi cp311 --abi abi3 \
            --abi none --platform manylinux_2_36_aarch64 --platform manylinux_2_34_aarch64 \
            --platform manylinux_2_28_aarch64 --platform manylinux_2_17_aarch64 \
            --platform manylinux2014_aarch64 --platform linux_aarch64 "$@"
    }
    fetch --require-hashes -r "$source/deploy/locks/drone.txt"
    fetch --require-hashes -r "$source/deploy/locks/build.txt"
    # The page: what a drone may serve, too.
    # shellcheck disable=SC2046
    fetch $("$python" -c 'import sys, tomllib
wanted = tomllib.load(open(sys.argv[1], "rb"))["project"]["optional-dependencies"]["ground"]
print(*(name.replace(" ", "") for name in wanted))' "$source/pyproject.toml")
    touch "$wheels/.complete"
fi

# The source as it is now, and the page, which needs Node to build.
copy=$work/root/src
rm -rf "$copy"
mkdir -p "$copy"
(cd "$source" && git ls-files -z src deploy native page pyproject.toml hatch_build.py README.md \
    LICENSE | tar -c --null -T - | tar -x -C "$copy")
[ ! -d "$source/src/uavrt/ground/static" ] ||
    cp -r "$source/src/uavrt/ground/static" "$copy/src/uavrt/ground/"

say "installing as on a Raspberry Pi"
SHARE="$wheels:/wheels" "$source/deploy/arm64/enter.sh" "$work" /usr/bin/env PIP_NO_INDEX=1 \
    PIP_FIND_LINKS=/wheels PIP_NO_COMPILE=1 /src/deploy/install.sh --radio none \
    --user root # the namespace has no other
SHARE="$wheels:/wheels" "$source/deploy/arm64/enter.sh" "$work" /opt/uavrt/venv/bin/python -m pip \
    install --quiet --no-index --find-links /wheels --no-compile 'uavrt[ground]'

"$python" "$source/deploy/arm64/checks.py" "$work"
