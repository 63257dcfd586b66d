#!/bin/sh
# Compare detection and its kernels on 64-bit ARM with this machine: short.sh DIRECTORY
#
# The short form of try-arm64.sh, a minute long, for every run of the tests. It uses a root with
# only Python, libraries as wheels, a wheel of this source with cross-compiled kernels (by Debian's
# compiler, unpacked below DIRECTORY if the machine has none), and one recording. The pulses must be
# those of this machine. Ends with 77 only if the kernel does not let users register an emulator.
# DIRECTORY is used again, so that the network is needed only once, and after a lock has
# changed.
set -eu

work=${1:?short.sh DIRECTORY}
mkdir -p "$work"
work=$(cd "$work" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
source=$(cd "$here/../.." && pwd)
python=${PYTHON:-$source/.venv/bin/python}
fail() { printf '%s\n' "short.sh: $*" >&2; exit 1; }

said=$("$here/enter.sh" --allowed 2>&1) || { echo "short.sh: skipped: $said"; exit 77; }
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null ||
    fail "no apt-get and dpkg-deb, which unpack Debian: install the packages apt and dpkg"
LIST=$here/packages-short.txt "$here/make-root.sh" "$work" >"$work/root.log" 2>&1 ||
    fail "no packages of Debian: $(tail -n 3 "$work/root.log")"
[ -x "$work/qemu-aarch64-static" ] || fail "no emulator: sudo apt install qemu-user-static"
said=$("$here/enter.sh" "$work" uname -m 2>&1) || true
[ "$said" = aarch64 ] ||
    fail "the emulator does not run, remove $work to unpack it again: $said"

# The compiler, as if it were installed.
cc=aarch64-linux-gnu-gcc
if ! command -v $cc >/dev/null; then
    cross=$work/cross
    if [ ! -e "$cross/.complete" ]; then
        mkdir -p "$cross/archives/partial"
        apt-get install -y -qq --download-only --no-install-recommends -o Debug::NoLocking=true \
            -o Dir::Cache::archives="$cross/archives" gcc-aarch64-linux-gnu libc6-dev-arm64-cross \
            >"$work/cross.log" 2>&1 ||
            fail "no compiler, sudo apt install gcc-aarch64-linux-gnu: $(tail -n 3 "$work/cross.log")"
        rm -f "$cross"/archives/lib*san*.deb # sanitizers, half of it all
        for deb in "$cross"/archives/*.deb; do dpkg-deb -x "$deb" "$cross"; done
        sed -i 's|/usr/aarch64-linux-gnu/lib/||g' "$cross"/usr/aarch64-linux-gnu/lib/lib[cm].so
        touch "$cross/.complete"
    fi
    LD_LIBRARY_PATH=$cross/usr/lib/$(uname -m)-linux-gnu
    export LD_LIBRARY_PATH
    libc=$cross/usr/aarch64-linux-gnu
    cc="$cross/usr/bin/$cc -isystem $libc/include -B$libc/lib -L$libc/lib"
fi

# The program: a wheel of this source for that processor, without the page.
copy=$work/copy
rm -rf "$copy" "$work/wheel"
mkdir -p "$copy"
(cd "$source" && git ls-files -z src deploy native pyproject.toml hatch_build.py README.md LICENSE |
    tar -c --null -T - | tar -x -C "$copy")
(cd "$copy" && CC=$cc UAVRT_PLATFORM=manylinux_2_17_aarch64 UAVRT_PAGE=optional \
    "$python" -m hatchling build -t wheel -d "$work/wheel" >"$work/wheel.log" 2>&1) ||
    { cat "$work/wheel.log"; exit 1; }
unset LD_LIBRARY_PATH
environment=$work/root/opt/uavrt/venv
fetch() {
    "$python" -m pip install -q --disable-pip-version-check --no-compile --no-deps --upgrade \
        --target "$environment/lib" --only-binary=:all: --implementation cp --python-version 3.11 \
        --abi cp311 --abi abi3 --abi none --platform manylinux_2_34_aarch64 \
        --platform manylinux_2_28_aarch64 --platform manylinux_2_17_aarch64 \
        --platform manylinux2014_aarch64 --platform linux_aarch64 "$@"
}
lock=$source/deploy/locks/drone.txt
sum=$(sha256sum <"$lock")
if [ "$(cat "$environment/.complete" 2>/dev/null)" != "$sum" ]; then
    rm -rf "$environment"
    fetch --require-hashes -r "$lock" >"$work/pip.log" 2>&1 ||
        fail "no wheels for 64-bit ARM as $lock has them: is the network there? Pin others with \`make locks\`: $(tail -n 3 "$work/pip.log")"
    mkdir -p "$environment/bin"
    printf '#!/bin/sh\nPYTHONPATH=/opt/uavrt/venv/lib exec python3 "$@"\n' >"$environment/bin/python"
    printf '#!/bin/sh\nexec /opt/uavrt/venv/bin/python -m uavrt.cli "$@"\n' >"$environment/bin/uavrt"
    chmod +x "$environment"/bin/*
    echo "$sum" >"$environment/.complete"
fi
rm -rf "$environment"/lib/uavrt "$environment"/lib/uavrt-*.dist-info
fetch "$work"/wheel/*.whl
SAMPLES_S=16 "$python" "$here/checks.py" "$work" kernels recording
