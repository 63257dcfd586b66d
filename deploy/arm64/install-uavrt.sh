#!/bin/sh
# Install uavrt in an emulated root as on a Raspberry Pi: install-uavrt.sh DIRECTORY [OPTION...]
#
# DIRECTORY is one of make-root.sh; options are those of deploy/install.sh. Wheels for 64-bit ARM
# are fetched by this machine's pip, with the hashes of deploy/locks.
set -eu

source=$(cd "$(dirname "$0")/../.." && pwd)
python=${PYTHON:-$source/.venv/bin/python}
work=$(cd "$1" && pwd)
shift
wheels=$work/wheels
mkdir -p "$wheels"
fetch() {
    "$python" -m pip download -qq --disable-pip-version-check --only-binary=:all: \
        --dest "$wheels" --implementation cp --python-version 3.11 --abi cp311 --abi abi3 \
        --abi none --platform manylinux_2_36_aarch64 --platform manylinux_2_34_aarch64 \
        --platform manylinux_2_28_aarch64 --platform manylinux_2_17_aarch64 \
        --platform manylinux2014_aarch64 --platform linux_aarch64 "$@"
}
# What is there is fetched again when another lock wants others.
changed() { # MARK LOCK...: also the sum to leave in MARK
    mark=$wheels/$1
    shift
    sum=$(cd "$source/deploy/locks" && sha256sum "$@")
    [ "$(cat "$mark" 2>/dev/null)" != "$sum" ]
}
if changed .complete drone-page.txt build.txt; then
    fetch --require-hashes -r "$source/deploy/locks/drone-page.txt"
    fetch --require-hashes -r "$source/deploy/locks/build.txt"
    echo "$sum" >"$mark"
fi
# What the DDS binding is built from. The library's source, too: no apt in the root knows a mirror.
dds=$wheels/cyclonedds.tar.gz
case " $* " in
    *" --ros2 "*)
        if changed .dds-complete dds-build.txt dds.txt; then
            fetch --require-hashes -r "$source/deploy/locks/dds-build.txt"
            mkdir -p "$work/no-dds/bin" "$work/no-dds/include" "$work/no-dds/lib"
            touch "$work/no-dds/lib/libddsc.so"
            CYCLONEDDS_HOME=$work/no-dds "$python" -m pip download -qq --no-deps --dest "$wheels" \
                --no-binary=:all: --require-hashes -r "$source/deploy/locks/dds.txt"
            PYTHON=$python "$source/deploy/dds-wheel.sh" --source "$dds"
            echo "$sum" >"$mark"
        fi ;;
esac

# The source as it is now, and the page, which needs Node to build.
copy=$work/root/src
rm -rf "$copy"
mkdir -p "$copy"
(cd "$source" && git ls-files -z src deploy native page pyproject.toml hatch_build.py README.md \
    LICENSE | tar -c --null -T - | tar -x -C "$copy")
[ ! -d "$source/src/uavrt/ground/static" ] ||
    cp -r "$source/src/uavrt/ground/static" "$copy/src/uavrt/ground/"

# A key is named by its place on this machine, and read in the root.
for word in "$@"; do
    shift
    if [ "${before:-}" = --update-key ]; then
        cp "$word" "$copy/update-keys.pem"
        word=/src/update-keys.pem
    fi
    set -- "$@" "$word"
    before=$word
done

# The namespace has no other user than root.
SHARE="$wheels:/wheels" "$source/deploy/arm64/enter.sh" "$work" /usr/bin/env PIP_NO_INDEX=1 \
    PIP_FIND_LINKS=/wheels PIP_NO_COMPILE=1 DDS_SOURCE="file:///wheels/${dds##*/}" /src/deploy/install.sh --radio none --user root --page "$@"
