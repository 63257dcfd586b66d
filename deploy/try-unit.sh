#!/bin/sh
# Is the confined service still able to fly? `sudo deploy/try-unit.sh`
#
# Boots a systemd of its own (apt install systemd-container) over a copy-on-write view of this
# system, installs uavrt there with deploy/install.sh as its own user, gives it a radio that
# is a program and an autopilot at a serial port, detects for half a minute, and shows what
# the service reports. Needs root and the package servers; what it writes is removed at the end.
set -eu

source=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
mkdir "$work/upper" "$work/work" "$work/root"
leader=
finish() {
    [ -z "$leader" ] || nsenter -t "$leader" -a systemctl poweroff 2>/dev/null || true
    sleep 3
    umount "$work/root" 2>/dev/null || true
    rm -rf --one-file-system "$work"
}
trap finish EXIT
trap 'exit 130' INT TERM

mount -t overlay overlay -o "lowerdir=/,upperdir=$work/upper,workdir=$work/work" "$work/root"
tr -d - </proc/sys/kernel/random/uuid >"$work/root/etc/machine-id"
systemd-nspawn -D "$work/root" --register=no --keep-unit --console=pipe --boot \
    </dev/null >"$work/log" 2>&1 &
container=$!
sleep 10
leader=$(pgrep -P "$container" | head -1)
[ -n "$leader" ] || { cat "$work/log"; exit 1; }
inside() { nsenter -t "$leader" -a "$@"; }

inside env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin PYTHON=/usr/bin/python3 \
    PIP_CERT=/etc/ssl/certs/ca-certificates.crt "$source/deploy/install.sh" --radio none
python=/opt/uavrt/venv/bin/python
inside "$python" - <<'PYTHON'
"""The world, the tags, and settings with a stand-in radio and a serial port."""
import os, time
from pathlib import Path
from uavrt.config import write_tags
from uavrt.simulation import demo_scenario, write_scenario
place = Path("/var/lib/uavrt")
scenario = demo_scenario(300.0, 1).starting_at(time.time_ns())
write_scenario(scenario, place / "scenario.toml")
write_tags(place / "tags.toml", scenario.tags)
(place / "uavrt.toml").write_text(
    '[radio]\nprogram = ["/opt/uavrt/venv/bin/python", "-m", "uavrt.simulation.airspy_rx",'
    ' "--world", "/var/lib/uavrt/scenario.toml"]\n'
    '[mavlink]\naddress = "serial:///dev/ttyS9:57600"\n'
)
PYTHON
# A serial port whose other end says nothing: that it opens is what is seen.
inside "$python" -c '
import grp, os, pty, time, tty
ours, theirs = pty.openpty()
tty.setraw(theirs)
name = os.ttyname(theirs)
os.chown(name, 0, grp.getgrnam("dialout").gr_gid)
os.chmod(name, 0o660)
os.path.islink("/dev/ttyS9") and os.unlink("/dev/ttyS9")
os.symlink(name, "/dev/ttyS9")
time.sleep(90)
' &
inside systemctl restart uavrt
sleep 5
as_member() { inside runuser -u uavrt -- sh -c "cd /var/lib/uavrt && /opt/uavrt/venv/bin/uavrt $*"; }
as_member monitor --start tags.toml
sleep 30
as_member monitor --once | tee "$work/seen"
main=$(inside systemctl show uavrt -p MainPID --value)
inside grep -E 'NoNewPrivs|CapEff|Seccomp:' "/proc/$main/status"
inside systemd-analyze security uavrt --no-pager | tail -1
for line in 'detector-1 *detecting' 'receiver *receiving' 'connection *waiting for autopilot'; do
    grep -q "$line" "$work/seen" || { echo "not so: $line"; inside journalctl -u uavrt -n 20; exit 1; }
done
echo "the confined service flies"
