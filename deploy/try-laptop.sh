#!/bin/sh
# Test that the ground station installs on a bare laptop: `deploy/try-laptop.sh`
#
# Builds wheel and sdist of this source, then installs them for a new home directory by pipx and
# by uv, with only Python in the path: no Node, no compiler. Each must serve the page and
# write a starter. Needs PyPI and the environment of this source (`make setup`); three minutes.
set -eu

source=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
say() { printf '%s\n' "try-laptop: $*"; }

cd "$source"
UAVRT_PURE=1 .venv/bin/hatchling build -t wheel -t sdist -d "$work/dist" >/dev/null
ls -s --block-size=k "$work"/dist/*
python3 -m venv "$work/tools"
"$work/tools/bin/pip" install --quiet --disable-pip-version-check pipx uv
mkdir "$work/bin"
ln -s "$(command -v uname)" "$work/bin/uname"
# Itself, not a script that chooses among several.
ln -s "$(python3 -c 'import os, sys; print(os.path.realpath(sys.executable))')" "$work/bin/python3"

cat >"$work/page.py" <<'CHECK'
"""Start the ground station and look at its page: page.py UAVRT"""
import re, subprocess, sys, urllib.request

command = [sys.argv[1], "ground", "--page", "--no-browser", "--port", "0",
           "--output", "flights"]
with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
    try:
        for line in server.stdout:
            if found := re.search(r"http://\S+", line):
                break
        text = urllib.request.urlopen(found[0]).read().decode()
        script = re.search(r'src="(/assets/[^"]+\.js)"', text)[1]
        base = re.match(r"http://[^/]+", found[0])[0]
        print("page", len(text), "bytes, script", len(urllib.request.urlopen(base + script).read()))
    finally:
        server.terminate()
CHECK

try_it() { # NAME INSTALL... : what installs, then the file
    name=$1
    shift
    home=$work/home-$name
    mkdir -p "$home"
    # Certificates of this machine: it may reach the package servers through one of its own.
    clean() {
        env -i PATH="$work/bin" HOME="$home" LANG=C.UTF-8 \
            ${SSL_CERT_FILE:+SSL_CERT_FILE="$SSL_CERT_FILE"} "$@"
    }
    clean "$@" >"$home/log" 2>&1 || { cat "$home/log"; say "$name: not installed"; exit 1; }
    uavrt=$home/.local/bin/uavrt
    say "$name: uavrt $(clean "$uavrt" --version)"
    (cd "$home" && clean python3 "$work/page.py" "$uavrt")
    clean "$uavrt" starter install >/dev/null
    started=$(sed -n 's/^Exec="\(.*\)" ground/\1/p' "$home/.local/share/applications/uavrt-ground.desktop")
    clean "$started" --version >/dev/null
    say "$name: the starter starts $started" | sed "s|$home|~|"
    rm -rf "$home"
}
wheel=$(echo "$work"/dist/*.whl) sdist=$(echo "$work"/dist/*.tar.gz)
try_it pipx "$work/tools/bin/pipx" install "$wheel[ground,analysis]"
try_it uv "$work/tools/bin/uv" tool install --python "$work/bin/python3" "$wheel[ground,analysis]"
try_it sdist "$work/tools/bin/pipx" install "$sdist[ground]"
say "all tests passed"
