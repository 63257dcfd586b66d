"""Years on a memory card: what was promised stays, whatever disk, stars and clock do."""

from pathlib import Path

import pytest
from virtual_time import VirtualClock

from uavrt.config.settings import RecordingSettings, Settings
from uavrt.drone import card as card_module
from uavrt.drone.computer import computer_checks as checks
from uavrt.flight.flight_layout import new_flight_directory
from uavrt.flight.flight_order import flights_in_order, note_flight

DAY_NS = 86_400 * 10**9
SPRING_NS = 1_777_600_000 * 10**9
"""May 2026."""


def test_flights_of_1970_are_as_old_as_they_are(tmp_path: Path) -> None:
    """Before the file, names decide; a line that a power cut has torn harms no other."""
    old = new_flight_directory(tmp_path, SPRING_NS - DAY_NS)
    old.mkdir()
    flown = []
    for clock_ns in (SPRING_NS, 0, 60 * 10**9, SPRING_NS + DAY_NS, 30 * 10**9):
        flight = new_flight_directory(tmp_path, clock_ns)
        flight.mkdir()
        note_flight(flight)
        note_flight(flight)  # the supervisor was restarted
        flown.append(flight)
    assert flights_in_order(tmp_path) == [old, *flown]
    path = tmp_path / "flights_in_order.txt"
    assert len(path.read_text().splitlines()) == 5
    path.write_text(path.read_text()[:-7])
    last = new_flight_directory(tmp_path, 90 * 10**9)
    last.mkdir()
    note_flight(last)
    order = flights_in_order(tmp_path)
    assert order[-1] == last
    assert [flight for flight in order if flight in flown[:4]] == flown[:4]


@pytest.mark.parametrize(
    ("ahead_s", "ok", "says"),
    [
        (0.4, True, "the battery-backed clock agrees"),
        (-3600.0, False, "60 min behind"),
        (1e8, False, "1157 days ahead"),
        (None, True, "no battery"),
    ],
)
def test_the_battery_of_the_clock_is_looked_at(
    ahead_s: float | None,
    ok: bool,
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    clock_of_test: VirtualClock,
) -> None:
    monkeypatch.setattr(card_module, "SYSFS", tmp_path)
    clock_of_test.set_wall_ns(SPRING_NS)
    monkeypatch.setattr(checks, "_timedatectl", lambda: "yes")
    if ahead_s is not None:
        kept = tmp_path / "class/rtc/rtc0/since_epoch"
        kept.parent.mkdir(parents=True)
        kept.write_text(f"{SPRING_NS // 10**9 + int(ahead_s)}\n")
    finding = checks.check_clock()
    assert finding.ok == ok
    assert says in finding.text
    clock_of_test.set_wall_ns(86_400 * 10**9)
    lost = checks.check_clock()
    assert not lost.ok
    assert "fit a battery" in lost.remedy


def test_a_worn_emmc_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worn = card_module.Card(
        device="/dev/mmcblk0p2",
        kind="ext4",
        read_only=False,
        errors=3,
        written_gb=812.0,
        life_used_tenths=9,
    )
    monkeypatch.setattr(checks, "card_of", lambda _directory: worn)
    settings = Settings(recording=RecordingSettings(directory=str(tmp_path)))
    finding = checks.check_card(settings)
    assert not finding.ok
    assert "file-system errors: 3 · the flash memory is worn out" in finding.text
    assert "812 GB written" in finding.text
