#!/bin/sh
# Test that the confined service can run a flight: `sudo deploy/try-unit.sh`
#
# Boots a separate systemd over a copy-on-write view of this system (own-systemd.sh), and installs
# uavrt there with deploy/install.sh as its own user. A program replaces the radio, a serial port
# the autopilot. It detects for half a minute, and shows the service's reports.
# Needs root and the package servers; all files that it writes are removed at the end.
set -eu

. "$(dirname "$0")/own-systemd.sh"

boot
install_uavrt --radio none
python=/opt/uavrt/venv/bin/python
inside "$python" - <<'PYTHON'
"""The world, the tags, and settings with a stand-in radio and a serial port."""
import os, time
from pathlib import Path
from uavrt.config.tags.tag_files import write_tags
from uavrt.simulation.scene.demo_world import demo_scenario; from uavrt.simulation.scene.scenario_file import write_scenario
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
    grep -q "$line" "$work/seen" || { echo "missing: $line"; inside journalctl -u uavrt -n 20; exit 1; }
done
echo "the confined service runs a flight"
