#!/bin/sh
# Make a wheel of the DDS binding, with its library: dds-wheel.sh DIRECTORY
# Only fetch the library's source, to build without apt: dds-wheel.sh --source FILE
#
# The gateway to ROS 2 needs this wheel on 64-bit ARM under Linux, for which PyPI has none. Builds
# release 0.10.5 of Cyclone DDS (EPL 2.0 or BSD) from the source that Debian keeps, and the binding
# of that release, for this machine's processor and PYTHON. It takes a minute on a PC and downloads
# 45 MB, all checked against hashes. Needs gcc, libc6-dev and python3-dev; installs nothing. An
# existing wheel in DIRECTORY is kept. DDS_SOURCE names another place of the source.
set -eu

if [ "${1:-}" = --source ]; then only=$2 out=; else only= out=${1:?dds-wheel.sh DIRECTORY}; fi
locks=$(cd "$(dirname "$0")" && pwd)/locks
python=${PYTHON:-python3}
release=0.10.5
# Where this computer's own packages are from.
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Origin: Debian' 2>/dev/null | grep -v security | head -n 1) || :
from=${DDS_SOURCE:-${mirror:+${mirror}pool/main/c/cyclonedds/cyclonedds_$release.orig.tar.gz}}
[ -n "$from" ] || { echo "dds-wheel.sh: no Debian mirror in the apt sources: run apt-get update, or set DDS_SOURCE" >&2; exit 1; }
sum=84e3fc6af1dda2f128cda62efc56f8ef87f02a9db1414a63f52e387935837734
fetch() { # FILE
    "$python" -c 'import sys, urllib.request as r; r.urlretrieve(*sys.argv[1:])' "$from" "$1"
    echo "$sum  $1" | sha256sum --check --quiet
}
[ -z "$only" ] || { mkdir -p "$(dirname "$only")"; fetch "$only"; exit 0; }
mkdir -p "$out"
out=$(cd "$out" && pwd)
tag=$("$python" -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
made=$out/cyclonedds-$release-$tag-$tag-linux_$(uname -m).whl
[ ! -e "$made" ] || { echo "$made"; exit 0; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
cd "$work"
# The same wheel, whenever and wherever it is built.
CFLAGS="-g0 -ffile-prefix-map=$work=."
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-1767225600} # 2026
export CFLAGS SOURCE_DATE_EPOCH
"$python" -m venv tools
PATH=$work/tools/bin:$PATH
pip() { python -m pip "$@" --quiet --disable-pip-version-check --require-hashes; }
pip install -r "$locks/dds-build.txt"

fetch source.tar.gz
mkdir source build home home/bin
tar -xzf source.tar.gz -C source --strip-components=1
# Without what needs further libraries, and without its own compiler of types, which we do not use.
# Nor does it send or read descriptions of types: those of release 11 and its own are not the same,
# and topics then do not match. By name they do, as with all of ROS 2.
cmake -G Ninja -S source -B build -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$work/home" \
    -DCMAKE_INSTALL_LIBDIR=lib -DBUILD_IDLC=OFF -DBUILD_DDSPERF=OFF -DBUILD_TESTING=OFF \
    -DENABLE_SSL=OFF -DENABLE_SECURITY=OFF -DENABLE_SHM=OFF \
    -DENABLE_TYPE_DISCOVERY=OFF -DENABLE_TOPIC_DISCOVERY=OFF \
    -DENABLE_LTO=OFF >cmake.log || { cat cmake.log >&2; exit 1; }
cmake --build build --target install >build.log || { tail -n 40 build.log >&2; exit 1; }

# The binding finds its library beside itself, wherever the environment is moved.
LDFLAGS="-Wl,-rpath,\$ORIGIN/../cyclonedds.libs" CYCLONEDDS_HOME=$work/home STANDALONE_WHEELS=1 \
    pip wheel --no-cache-dir --no-deps --no-build-isolation --no-binary cyclonedds -w plain -r "$locks/dds.txt"
python -m wheel unpack plain/*.whl >wheel.log
place=$work/cyclonedds-$release
mkdir "$place/cyclonedds.libs"
rm -rf "$place/cyclonedds/.libs"
cp home/lib/libddsc.so.0 "$place/cyclonedds.libs/"
cp source/LICENSE "$place/cyclonedds.libs/"
python -m wheel pack "$place" --dest-dir "$out" >>wheel.log
[ -e "$made" ] || { echo "dds-wheel.sh: no $made" >&2; cat wheel.log >&2; exit 1; }
echo "$made"
