"""A season in numbers, from flights as they are recorded."""

import csv
from pathlib import Path

import made
import pytest
from command_line import Ran

from uavrt.analysis.season import read_season
from uavrt.core.clock import Clock
from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose, Tag
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.noted_places import vehicle_note
from uavrt.flight.reading.outline import battery_note

SECOND = 1_000_000_000
MAY_NS = 1_777_600_000 * SECOND


def tag(tag_id: int, megahertz: float, name: str | None = None) -> Tag:
    return made.tag(tag_id, megahertz * 1e6, 1.2, name=name)


LYNX, OTTER = tag(2, 148.7, "lynx"), tag(4, 148.9)


def fly(
    place: Path,
    start_s: int,
    *tags: Tag,
    minutes: int = 10,
    heard: dict[int, int] | None = None,
    notes: tuple[str, ...] = (),
    shift_ns: int = 0,
    snr_db: float = 20.0,
) -> None:
    """Record a flight that heard each tag of `heard` from that second on, every 1.2 s."""
    start_ns = MAY_NS + start_s * SECOND
    place.parent.mkdir(parents=True, exist_ok=True)
    info = made.flight_info(
        place,
        tags,
        start_time_ns=start_ns,
        clock_offset_ns=Clock.start().offset_ns,
        center_frequency_hz=148.8e6,
    )
    recorder = FlightRecorder.open(info)
    for tag_id, from_s in (heard or {}).items():
        times = range(start_ns + from_s * SECOND, start_ns + (from_s + 60) * SECOND, 12 * 10**8)
        recorder.write_pulses(
            [
                PulsePose(
                    pulse=made.pulse(time_ns + shift_ns, tag_id=tag_id, snr_db=snr_db),
                    pose=None,
                )
                for time_ns in times
            ]
        )
    recorder.write(
        made.search_report(
            tags[0].tag_id,
            start_ns + minutes * 60 * SECOND,
            frequency_hz=148.7e6,
            noise_psd=1e-9,
            best_score=0.3,
        )
    )
    for number, text in enumerate(notes):
        recorder.write_note(text, start_ns + number)
    recorder.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three flights, one of which lies there twice, and what is none."""
    own = vehicle_note(1)
    levels = [battery_note(percent) for percent in (95, 60, 42)]
    fly(tmp_path / "a/flight_log_1", 0, LYNX, OTTER, heard={2: 120}, notes=(own, *levels))
    # The drone's own copy: longer, by another road to the microsecond, and not in this order.
    fly(tmp_path / "b/flight_log_1", -5, LYNX, OTTER, minutes=12, heard={2: 125}, shift_ns=400)
    fly(
        tmp_path / "a/flight_log_2",
        1000,
        LYNX,
        OTTER,
        heard={2: 60, 4: 300},
        notes=(own, levels[1]),
    )
    fly(tmp_path / "a/flight_log_3", 9000, OTTER, minutes=20)
    (tmp_path / "a/flight_log_4").mkdir()
    (tmp_path / "a/flight_log_4/flight.sqlite").write_bytes(b"no database")
    return tmp_path


def test_flights_minutes_animals_and_batteries_are_counted(folder: Path) -> None:
    found = read_season(folder)
    assert (found.flights, found.copies, found.minutes) == (3, 1, 12 + 10 + 20)
    assert found.unreadable == ("a/flight_log_4",)
    assert found.animals_heard == 2
    assert found.minutes_per_animal == pytest.approx(42 / 3)
    lynx, otter = found.animals
    assert (lynx.name, lynx.flights, lynx.flights_heard, lynx.minutes) == ("lynx", 2, 2, 22)
    assert lynx.minutes_to_hear == pytest.approx(1.5, abs=0.1)
    assert (otter.flights, otter.flights_heard, otter.minutes) == (3, 1, 42)
    assert otter.last_heard_ns == MAY_NS + (1000 + 300) * SECOND + 49 * 12 * 10**8
    # 95 to 42 %, then one with 60 % was put in; the third flight and nobody noted it.
    assert (found.batteries, found.flights_without_battery) == (2, 1)
    assert found.batteries_used == pytest.approx(0.53)


def test_two_drones_at_the_same_time_are_two_flights(tmp_path: Path) -> None:
    for number in (1, 2):
        fly(tmp_path / f"{number}", 0, LYNX, heard={2: 60}, notes=(vehicle_note(number),))
    # Without a word whose it is the pulses decide.
    fly(tmp_path / "3", 0, LYNX, heard={2: 61}, shift_ns=SECOND // 2)
    assert read_season(tmp_path).flights == 3


def test_two_drones_side_by_side_that_hear_the_same_pulses_are_two_flights(
    tmp_path: Path,
) -> None:
    for number, snr_db in enumerate((20.0, 15.0)):
        for copy in "ab":
            fly(tmp_path / copy / f"{number}", 0, LYNX, heard={2: 60}, snr_db=snr_db)
    found = read_season(tmp_path)
    assert (found.flights, found.copies) == (2, 2)


def test_a_battery_that_two_stations_noted_is_one(tmp_path: Path) -> None:
    """The second station came late, and has named the vehicle; it and the drone have copies."""
    levels = [battery_note(percent) for percent in (95, 60, 42)]
    fly(tmp_path / "A/flight_log_1", 0, LYNX, heard={2: 120}, notes=(vehicle_note(1), *levels))
    late = (vehicle_note(1, "North"), *levels[1:])
    fly(tmp_path / "B/flight_log_1", 9, LYNX, minutes=9, heard={2: 111}, notes=late)
    fly(tmp_path / "drone/flight_log_1", 0, LYNX, heard={2: 120})
    found = read_season(tmp_path)
    assert (found.flights, found.copies, found.batteries) == (1, 2, 1)
    assert found.batteries_used == pytest.approx(0.53)
    # The next flight with the same battery, of which the first station knows alone.
    more = [vehicle_note(1), battery_note(40), battery_note(30)]
    fly(tmp_path / "A/flight_log_2", 3600, LYNX, heard={2: 120}, notes=tuple(more))
    found = read_season(tmp_path)
    assert (found.flights, found.batteries) == (2, 1)
    assert found.batteries_used == pytest.approx(0.65)


@pytest.mark.parametrize("of_a_station", [True, False])
def test_flights_in_vain_of_a_clock_that_begins_anew_are_as_many_as_they_are(
    tmp_path: Path, of_a_station: bool
) -> None:
    """One recorder records a flight once: what lies side by side are different flights."""
    own = (vehicle_note(1),) if of_a_station else ()
    for number in (1, 2, 3):
        fly(tmp_path / f"flight_log_{number}", number, LYNX, minutes=20, notes=own)
    found = read_season(tmp_path)
    assert (found.flights, found.copies, found.minutes) == (3, 0, 60)


def test_copies_of_flights_in_vain_are_found_by_their_time(tmp_path: Path) -> None:
    own = (vehicle_note(1),)
    for number in (1, 2):
        start_s = 1500 * number
        fly(tmp_path / f"drone/flight_log_{number}", start_s, LYNX, minutes=20)
        fly(tmp_path / f"ground/flight_log_{number}", start_s + 3, LYNX, minutes=20, notes=own)
        # The drone's own directory once more, as it was copied.
        fly(tmp_path / f"usb/{number}/flight_log_{number}", start_s, LYNX, minutes=20)
    found = read_season(tmp_path)
    assert (found.flights, found.copies) == (2, 4)


def test_days_of_a_clock_that_begins_anew_are_different_flights(tmp_path: Path) -> None:
    for day in (1, 2):
        fly(tmp_path / f"{day}/flight_log_1970-01-01_00-05-00", day, LYNX, minutes=20)
    found = read_season(tmp_path)
    assert (found.flights, found.copies) == (2, 0)


def test_another_animal_with_the_same_number_is_another(tmp_path: Path) -> None:
    fly(tmp_path / "1", 0, LYNX)
    fly(tmp_path / "2", 9000, tag(2, 151.2, "marten"))
    assert [one.name for one in read_season(tmp_path).animals] == ["lynx", "marten"]


def test_a_folder_without_flights_is_told(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="Name the folder"):
        read_season(tmp_path)


def test_the_command_prints_the_season_and_writes_a_line_for_each_animal(
    folder: Path, ran: Ran
) -> None:
    table = folder / "season.csv"
    said = ran("season", folder, "-o", table)
    assert "3 flights, 42 minutes" in said.out
    assert "14.0 minutes of flight per detection" in said.out
    assert "flight_log_4 cannot be read" in said.err
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["tag_id"] for row in rows] == ["2", "4"]
    assert ran("season", folder, "--json").json["batteries"] == 2
