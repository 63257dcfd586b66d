#!/bin/sh
# Compare uavrt on 64-bit ARM with this machine: `deploy/try-arm64.sh [DIRECTORY]`, or
# `make try-arm64`
#
# Makes a Debian root for 64-bit ARM, runs it in an emulator (enter.sh: needs no root rights,
# changes nothing on this machine), installs uavrt there with deploy/install.sh as on a
# Raspberry Pi, and compares it with this machine (arm64/checks.py): doctor, pulses of a
# recording, the page, messages over ROS 2, the processes killed and restarted in a flight. Needs
# the package servers of Debian and PyPI, the uavrt of this source (`make setup`) and 3 GB. Takes
# ten to twenty minutes, mostly in the emulator, plus the time to compile the DDS library.
# With DIRECTORY everything is kept there, and the next run continues from it; otherwise it is
# removed at the end.
set -eu

source=$(cd "$(dirname "$0")/.." && pwd)
if [ $# -gt 0 ]; then
    mkdir -p "$1"
    work=$(cd "$1" && pwd)
else
    work=$(mktemp -d)
    trap 'rm -rf --one-file-system "$work"' EXIT
    trap 'exit 130' INT TERM
fi
say() { printf '%s\n' "try-arm64: $*"; }

said=$("$source/deploy/arm64/enter.sh" --allowed 2>&1) || { say "skipped: $said"; exit 77; }
"$source/deploy/arm64/make-root.sh" "$work"
said=$("$source/deploy/arm64/enter.sh" "$work" uname -m 2>&1) || true
[ "$said" = aarch64 ] || { say "the emulator does not run: $said" >&2; exit 1; }
say "a root for $said, by $("$work/qemu-aarch64-static" --version | head -1)"
say "installing as on a Raspberry Pi"
"$source/deploy/arm64/install-uavrt.sh" "$work" --ros2
"${PYTHON:-$source/.venv/bin/python}" "$source/deploy/arm64/checks.py" "$work"
