"""Patterns from files, and patterns that a flight teaches."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import Ran
from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.estimates.bearings import learnt_antenna, read_recorded
from uavrt.analysis.measure.antenna_files import antenna_named, read_antenna, write_antenna
from uavrt.core.errors import ConfigError, FormatError, UsageError
from uavrt.localization.antenna import PATTERNS
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.scenario import Scenario


def test_a_pattern_comes_back_from_its_file(tmp_path: Path) -> None:
    for name in ("RA-23K", "H"):
        path = tmp_path / f"{name}.csv"
        write_antenna(PATTERNS[name], path, "from the maker")
        back = read_antenna(path)
        angle = np.arange(0.0, 181.0, 10.0)
        assert back.gain_db(angle) == pytest.approx(PATTERNS[name].gain_db(angle), abs=0.006)
        assert (back.h_plane_db is None) == (PATTERNS[name].h_plane_db is None)


def test_both_sides_of_a_measured_pattern_are_averaged_and_boresight_is_zero(
    tmp_path: Path,
) -> None:
    path = tmp_path / "mine.csv"
    path.write_text(
        "angle,gain\n# measured on the mast\n0, 6.6\n30, 4\n-30, 5\n330, 6\n60,1\n90,-9\n"
        "120,-10\n150,-6\n180, -4 # the back\n"
    )
    pattern = read_antenna(path)
    assert pattern.gain_db([0.0, 30.0, -30.0, 180.0]) == pytest.approx([0, -1.6, -1.6, -10.6])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("0,0\n30,x\n", "line 2"),
        ("0,0\n30,1,2,3\n", "line 2"),
        ("0,0\n180,nan\n", "line 2"),
        ("0,0\n10,-1\n", "range of 170°"),
        ("", "is not a table"),
        ("0,0\n90,1,1\n180,0\n", "is not a table"),
    ],
)
def test_a_file_that_is_no_pattern_is_refused(tmp_path: Path, text: str, word: str) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=word):
        read_antenna(path)


def test_neither_a_name_nor_a_file_is_refused_and_our_names_stay_ours(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no antenna"):
        antenna_named("nothing.csv")
    assert antenna_named("RA-2A") == "RA-2A"
    with pytest.raises(ConfigError, match="reserved by uavrt"):
        PATTERNS.add("RA-2A", PATTERNS["H"])
    path = tmp_path / "mast antenna.csv"
    write_antenna(PATTERNS["H3"], path, "as measured")
    assert antenna_named(str(path)) == "mast antenna.csv"
    assert "mast antenna.csv" in PATTERNS


def test_a_flight_teaches_the_antenna_as_it_is_on_the_airframe(
    write_flight: WriteFlight,
    scenario_of: Callable[[int], Scenario],
    tmp_path: Path,
    ran: Ran,
) -> None:
    """Three turns past four tags; the true antenna has 4 dB less behind than its table."""
    true = np.array(PATTERNS["RA-23K"].e_plane_db)
    true[9:] += np.linspace(0.0, -6.0, len(true) - 9)
    mounted = Antenna(pattern="table", table_db=tuple(float(value) for value in true))
    scenario = replace(scenario_of(4), antenna=mounted)
    flight = write_flight(scenario=scenario, tags=4, heard=4, name="flight_log_learn")
    table = tmp_path / "learnt.csv"
    assert len(ran("bearing", flight, "--learn", table, "--json").json) == 12
    angle = np.arange(0.0, 181.0, 10.0)
    before = PATTERNS["RA-23K"].gain_db(angle) - true
    after = read_antenna(table).gain_db(angle) - true
    assert np.sqrt(np.mean(after**2)) < 0.6 * np.sqrt(np.mean(before**2))


def test_too_few_turns_teach_nothing(write_flight: WriteFlight, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="0 turns"):
        learnt_antenna(read_recorded(write_flight(heard=0)), "RA-23K")
    (tmp_path / "Pulse.csv").write_text("")
    with pytest.raises(UsageError, match="0 turns"):
        learnt_antenna(read_recorded(tmp_path / "Pulse.csv"), "RA-23K")
