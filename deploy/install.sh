#!/bin/sh
# Install uavrt and start its service on Debian 12, Ubuntu 24.04 or Raspberry Pi OS 12 (or newer,
# 64-bit). Run it as often as you like: it changes only what is out of date.
#
#   sudo deploy/install.sh [options]
#
#   --radio NAME     airspy (default), another kind of docs/reference/radios.md, or none
#   --user NAME      user of the service (default uavrt, created if missing)
#   --directory DIR  settings and flights (default /var/lib/uavrt)
#   --prefix DIR     the program (default /opt/uavrt)
#   --ros2           also install the gateway to ROS 2
#   --page           also install the libraries to serve the ground station's page from the drone
#   --update-key FILE  public key (PEM) that signs updates for `uavrt update`
#   --root DIR       install below DIR: no system packages, no groups; nothing is started
set -eu

say() { printf '%s\n' "uavrt: $*"; }
fail() { printf '%s\n' "uavrt: $*" >&2; exit 1; }

radio=airspy user=uavrt directory=/var/lib/uavrt prefix=/opt/uavrt
locks=drone.txt root= update_key=
while [ $# -gt 0 ]; do
    case $1 in
        --ros2) locks="$locks drone-ros2.txt"; shift; continue ;;
        --page) locks="$locks drone-page.txt"; shift; continue ;;
        -h | --help) sed -n '2,15s/^# \{0,1\}//p' "$0"; exit 0 ;;
    esac
    [ $# -ge 2 ] || fail "$1 needs a value, or is unknown (--help)"
    case $1 in
        --radio) radio=$2 ;;
        --user) user=$2 ;;
        --directory) directory=$2 ;;
        --prefix) prefix=$2 ;;
        --root) root=${2%/} ;;
        --update-key) update_key=$2 ;;
        *) fail "unknown option $1 (--help)" ;;
    esac
    shift 2
done
source=$(cd "$(dirname "$0")/.." && pwd)
[ -z "$update_key" ] || update_key=$(realpath -- "$update_key")
[ -z "$root" ] || root=$(mkdir -p "$root" && realpath -- "$root")
case ${PYTHON:-} in */*) PYTHON=$(realpath -s -- "$PYTHON") ;; esac
# Python imports from the working directory, which may be the service's user's.
cd /
as_user() { # COMMAND...: on files that this user may have turned into links to root's
    if [ -z "$root" ]; then runuser -u "$user" -- "$@"; else "$@"; fi
}

# The package of the radio's row in the table of radios.
radios=$source/src/uavrt/config/radios.py package=
case $radio in
    none) ;;
    *[!a-z0-9]*) fail "unknown radio $radio (--help)" ;;
    *) package=$(sed -n "/^ *kind=\"$radio\"/,/^ *),\$/s/^ *package=\"\(.*\)\",.*/\1/p" "$radios")
       [ -n "$package" ] ||
           fail "unknown radio $radio: $(sed -n 's/^ *kind="\(.*\)",/\1,/p' "$radios" | tr '\n' ' ')or none" ;;
esac

# 1. Packages of the system: Python's venv, the radio's program, setpriv, openssl for updates.
if [ -z "$root" ]; then
    [ "$(id -u)" = 0 ] || fail "run it with sudo"
    command -v apt-get >/dev/null || fail "no apt-get: this is for Debian, Ubuntu, Raspberry Pi OS"
    missing=
    # There is no wheel of the DDS binding for 64-bit ARM: it is built.
    [ "$locks" = "${locks#*ros2}" ] || [ "$(uname -m)" = x86_64 ] ||
        package="$package gcc libc6-dev python3-dev"
    for name in python3-venv util-linux openssl $package; do
        dpkg-query -W -f '${Status}' "$name" 2>/dev/null | grep -q 'ok installed' ||
            missing="$missing $name"
    done
    if [ -n "$missing" ]; then
        say "installing$missing"
        apt-get update -qq
        # shellcheck disable=SC2086
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing
    fi
fi

# 2. The program, in an environment of its own.
python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    fail "Python 3.11 or newer is needed; this is $("$python" --version)"
# A version of its own (uavrt.drone.computer.versions): `uavrt update` puts others beside it.
environment=$root$prefix/versions/source link=$root$prefix/venv
mkdir -p "$root$prefix/versions"
if [ -d "$link" ] && [ ! -L "$link" ]; then
    say "$link becomes $environment"
    mv "$link" "$environment"
    rm -f "$environment/.uavrt-source"
fi
[ -x "$environment/bin/python" ] || "$python" -m venv "$environment"
by_name() { # DIRECTORY WORDS...: install from the wheels there
    place=$1
    shift
    env -u PIP_FIND_LINKS "$environment/bin/python" -m pip install --quiet --no-index --no-deps \
        --find-links "$place" "$@"
}
stamp=$environment/.uavrt-source
# What the source is: the sum over its files, so that an unchanged one is not built again.
fingerprint() {
    (cd "$source" && find pyproject.toml hatch_build.py src deploy/locks -type f \
        ! -path '*/__pycache__/*' -exec cksum {} + | sort -k3 | cksum)
    printf '%s' "$locks"
}
if [ "$(cat "$stamp" 2>/dev/null)" = "$(fingerprint)" ]; then
    say "the program is up to date"
else
    say "installing the program into $environment"
    # Only files whose hashes stand in deploy/locks come from outside, to build and to run.
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    "$python" -m venv "$work/venv"
    "$work/venv/bin/python" -m pip install --quiet --require-hashes -r "$source/deploy/locks/build.txt"
    # A drone finds animals without the ground station's page: no Node must not stop it here.
    UAVRT_PAGE=optional "$work/venv/bin/python" -m pip wheel --quiet --no-deps \
        --no-build-isolation --wheel-dir "$work" "$source"
    for lock in $locks; do # they agree on the versions
        "$environment/bin/python" -m pip install --quiet --require-hashes -r "$source/deploy/locks/$lock"
    done
    # By name: pip writes down where a file given by its path lay, another place each time.
    by_name "$work" --force-reinstall uavrt
    # After the build, which writes the MAVLink dialect into the source.
    fingerprint >"$stamp"
    rm -f "$link"
fi
if [ ! -L "$link" ]; then
    rm -f "$root$prefix/trial"
    ln -s versions/source "$link"
fi
# Who logs in calls `uavrt`: by way of the link that an update turns to another version.
command=$root/usr/local/bin/uavrt leads=$(readlink "$root/usr/local/bin/uavrt" || true)
case $leads in
    "$link/bin/uavrt") ;;
    */venv/bin/uavrt) ln -sf "$link/bin/uavrt" "$command" ;; # of another --prefix
    *)
        if [ -e "$command" ] || [ -n "$leads" ]; then
            say "$command belongs to another program and is kept: call $link/bin/uavrt"
        else
            mkdir -p "$root/usr/local/bin"
            ln -s "$link/bin/uavrt" "$command"
        fi ;;
esac
[ -z "$update_key" ] || install -C -m 644 "$update_key" "$root$prefix/update-keys.pem"

# The DDS binding has no wheel for 64-bit ARM: it is built once and kept, for `uavrt update`, too.
# All else runs without it.
if [ "$locks" != "${locks#*ros2}" ] && ! "$environment/bin/python" -c 'import cyclonedds.core' 2>/dev/null; then
    say "building the DDS binding for $(uname -m): a minute on a PC, longer on a small board"
    if wheel=$(PYTHON="$environment/bin/python" "$source/deploy/dds-wheel.sh" "$root$prefix/wheels"); then
        by_name "$(dirname "$wheel")" cyclonedds
    else
        say "no DDS binding: the gateway to ROS 2 stays off (docs/how-to/ros2.md)"
    fi
fi

# 3. A place for settings and flights, and the groups for serial port and radio.
mkdir -p "$root$directory"
if [ ! -e "$root$directory/uavrt.toml" ]; then
    "$environment/bin/python" -c \
        'import sys; from uavrt.config.loader import write_default_settings as w; w(sys.argv[1])' \
        "$root$directory/uavrt.toml"
    say "wrote $root$directory/uavrt.toml: please read it"
fi
if [ -z "$root" ]; then
    id "$user" >/dev/null 2>&1 || {
        say "making the user $user"
        useradd --system --user-group --home-dir "$directory" --shell /usr/sbin/nologin "$user"
    }
    join() { id -nG "$2" | tr ' ' '\n' | grep -qx "$1" || usermod -a -G "$1" "$2"; }
    for group in dialout plugdev; do
        getent group "$group" >/dev/null || groupadd --system "$group"
        join "$group" "$user"
    done
    chown -R "$user:" "$directory"
    if [ "$user" = uavrt ]; then
        # Who is in its group reads flights, edits the settings and uses `uavrt monitor`.
        chmod 770 "$directory"
        as_user chmod 660 "$directory/uavrt.toml"
        [ -z "${SUDO_USER:-}" ] || [ "$SUDO_USER" = root ] || join uavrt "$SUDO_USER"
    fi
fi

# 4. Unit and udev rule; the service starts now and at every boot.
"$link/bin/uavrt" service install --user "$user" --directory "$directory" \
    --root "${root:-/}"

say "done. Still missing:"
(cd "$root$directory" && as_user "$link/bin/uavrt" doctor) || true
