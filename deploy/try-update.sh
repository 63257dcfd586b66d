#!/bin/sh
# Test that `uavrt update` keeps a good version and reverts a bad one: `sudo deploy/try-update.sh`
#
# Boots a separate systemd over a copy-on-write view of this system (own-systemd.sh), installs
# uavrt there with deploy/install.sh, and updates it from signed files, with the time limits of
# the field: while the vehicle is armed, from a broken file, to a good version, to an older one,
# to one that never gives a pose, and to one whose service fails at its start, with a power cut
# during that trial. An earlier flight must not change by a byte. Needs root, PyPI and the uavrt
# of this source (`make setup`); takes ten minutes. All files that it writes are removed.
set -eu

. "$(dirname "$0")/own-systemd.sh"
python() { PYTHONPATH="$source/src" "${PYTHON:-$source/.venv/bin/python}" "$@"; }
port=14745 flight=/var/lib/uavrt/flights/flight_log_2026-05-01_08-15-00

say "making versions"
openssl genpkey -algorithm ed25519 -out "$work/release.pem"
openssl pkey -in "$work/release.pem" -pubout -out "$work/upper/src/update-keys.pem"
present=$(sed -n 's/^__version__ = "\(.*\)"/\1/p' "$source/src/uavrt/__init__.py")
make_wheel() { # VERSION [FILE SED-SCRIPT]: a wheel of this source, spoilt if told how
    copy=$work/copy
    cp -r "$work/upper/src" "$copy"
    sed -i "s/^\(__version__\|version\) = \"$present\"/\1 = \"$1\"/" \
        "$copy/src/uavrt/__init__.py" "$copy/pyproject.toml"
    if [ $# -gt 1 ]; then
        sed -i "$3" "$copy/$2"
        ! cmp -s "$copy/$2" "$source/$2" || { say "$2 was not spoilt"; exit 1; }
    fi
    (cd "$copy" && UAVRT_PAGE=optional python -m hatchling build -t wheel -d "$work/$1" >/dev/null)
    rm -r "$copy"
}
good=$present.post1 poseless=$present.post2 dying=$present.post3 older=0.0.1
make_wheel "$good"
make_wheel "$poseless" src/uavrt/drone/processes/connection.py 's/frame\.send("poses", poses)/None/'
make_wheel "$dying" src/uavrt/drone/supervisor/supervisor_program.py 's/^    gc\.freeze().*/    os._exit(1)/'
make_wheel "$older"
sign() { python "$source/deploy/make-update.py" --key "$work/release.pem" "$@"; }
minor=$(/usr/bin/python3 -c 'import sys; print(f"{sys.version_info[0]}.{sys.version_info[1]}")')
sign -o "$work/good.tar" --machine "$(uname -m)" --python "$minor" "$work/$good"/*.whl
sign --alone "$work/$poseless"/*.whl "$work/$dying"/*.whl "$work/$older"/*.whl
head -c 20000000 "$work/good.tar" >"$work/broken.tar"

say "installing $present"
boot
install_uavrt --radio none --update-key "$source_in_it/update-keys.pem" >"$work/install.log" 2>&1 ||
    { tail -n 20 "$work/install.log"; exit 1; }
give() { inside sh -c 'cat >"$1"' sh "$1"; } # FILE: what is on stdin
inside mkdir -p "$flight"
head -c 300000 /dev/urandom | give "$flight/flight.sqlite"
inside chown -R uavrt: /var/lib/uavrt/flights
kept() {
    inside find "$flight" -printf '%p %T@ %m %u\n'
    inside sha256sum "$flight/flight.sqlite"
}
before=$(kept)
printf '[mavlink]\naddress = "udpin://127.0.0.1:%s"\n' "$port" | give /var/lib/uavrt/uavrt.toml

# The vehicle flies outside; the drone side hears it at a port of this machine.
python - "$work/scenario.toml" <<'PYTHON'
import sys, time
from pathlib import Path
from uavrt.simulation.scene.demo_world import demo_scenario; from uavrt.simulation.scene.scenario_file import write_scenario
write_scenario(demo_scenario(3600.0, 1).starting_at(time.time_ns()), Path(sys.argv[1]))
PYTHON
vehicle=
land() { [ -z "$vehicle" ] || { kill "$vehicle" && wait "$vehicle"; } 2>/dev/null || true; }
trap 'land; finish' EXIT
fly() { # OPTION... of the simulated autopilot
    land
    PYTHONPATH="$source/src" "${PYTHON:-$source/.venv/bin/python}" -m uavrt.simulation.autopilot \
        --scenario "$work/scenario.toml" --companion "127.0.0.1:$port" "$@" >"$work/vehicle.log" 2>&1 &
    vehicle=$!
}

update() { # FILE...: as the manual says; STATUS, what it SAID, and whether all is as it was
    for file in "$@"; do give "/src/$(basename "$file")" <"$file"; done
    began=$(date +%s) status=0
    said=$(inside sh -c 'cd /var/lib/uavrt && /opt/uavrt/venv/bin/uavrt update "/src/$1"' sh \
        "$(basename "$1")" 2>&1) || status=$?
    printf '%s\n' "$said" | sed 's/^/  | /'
    say "status $status after $(($(date +%s) - began)) s, venv -> $(version)"
    [ "$(kept)" = "$before" ] || { say "FAILED: the earlier flight has changed"; exit 1; }
}
version() { basename "$(inside readlink /opt/uavrt/venv)"; }
must() { # STATUS VERSION TEXT: what has to have come of it
    case "$status $(version) $said" in
        "$1 $2"*"$3"*) say "ok: $3" ;;
        *) say "FAILED: expected $1, $2, '$3'"; inside journalctl -n 60 --no-pager; exit 1 ;;
    esac
}
ready() { # the service is there, of this version, and tells that it hears the autopilot
    tries=0
    until (inside sh -c 'cd /var/lib/uavrt && /opt/uavrt/venv/bin/uavrt monitor --once' 2>&1 || true) |
        grep -q 'connection *\(waiting for ground station\|ready\)'; do
        tries=$((tries + 1))
        [ "$tries" -lt 60 ] || { say "the service is not ready"; inside journalctl -n 40 --no-pager; exit 1; }
        sleep 1
    done
}

fly
inside systemctl restart uavrt
ready
update "$work/good.tar"
must 2 source "the vehicle is armed: nothing was changed"
fly --flies --on-ground --ground 127.0.0.1:14746
ready
update "$work/broken.tar"
must 2 source "is not an update, or is damaged"
update "$work/good.tar"
must 0 "$good-" "is good, and stays"
ready
update "$work/$older"/*.whl "$work/$older"/*.sig
must 2 "$good-" "is not newer than"
update "$work/$poseless"/*.whl "$work/$poseless"/*.sig
must 1 "$good-" "not there: poses): back to $good"
ready

say "a power cut while a version is on trial whose service dies"
for file in "$work/$dying"/*; do give "/src/$(basename "$file")" <"$file"; done
inside sh -c 'cd /var/lib/uavrt && exec /opt/uavrt/venv/bin/uavrt update /src/*.post3-*.whl' \
    >"$work/said" 2>&1 &
until grep -q "on trial" "$work/said"; do
    [ -d "/proc/$!" ] || { cat "$work/said"; exit 1; }
    sleep 1
done
sleep 5
inside sync
cut_power
say "cut, with venv -> $(readlink "$work/upper/opt/uavrt/venv")"
began=$(date +%s)
boot
until [ "$(inside systemctl show uavrt-update -p ActiveState --value)" = inactive ] ||
    inside systemctl is-failed -q uavrt-update; do sleep 2; done
status=0 said=$(inside journalctl -u uavrt-update --no-pager -o cat)
printf '%s\n' "$said" | sed 's/^/  | /'
say "ended by itself $(($(date +%s) - began)) s after the start, venv -> $(version)"
must 0 "$good-" "back to $good"
ready
[ "$(kept)" = "$before" ] || { say "FAILED: the earlier flight has changed"; exit 1; }
say "a good version stays, bad ones are removed, the earlier flight is unchanged"
