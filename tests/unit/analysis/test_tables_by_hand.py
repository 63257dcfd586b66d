"""Tables of bearings taken by hand, with the headings of other groups."""

from pathlib import Path

import pytest

from uavrt.analysis.estimates.positions import read_positions
from uavrt.core.errors import FormatError
from uavrt.formats.bearings_csv import read_bearing_file

TABLE = """\
Date,Time,Animal,Frequency,Lat,Lon,Azimuth,Declination
2026-08-01,08:00,F01,150.123,46.0000,8.0000,36.0,3.0
2026-08-01,08:10,F01,150.123,46.0000,8.0100,320.0,3.0
2026-08-01,08:20,F01,150.123,46.0100,8.0000,144.0,3.0
"""


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_magnetic_bearings_of_a_named_animal_meet_at_its_place(tmp_path: Path) -> None:
    path = written(tmp_path / "table.csv", TABLE)
    rows = read_bearing_file(path)
    assert [row.bearing_deg for row in rows] == [39.0, 323.0, 147.0]
    assert [row.start_time_ns for row in rows] == [
        1_785_571_200_000_000_000 + 600_000_000_000 * number for number in range(3)
    ]
    (found,) = read_positions(path)
    assert (found.tag_id, found.name) == (1, "F01")
    assert found.position is not None
    assert found.position.latitude_deg == pytest.approx(46.0045, abs=1e-4)
    assert found.position.longitude_deg == pytest.approx(8.0052, abs=1e-4)


@pytest.mark.parametrize(
    ("heading", "row", "bearing_deg"),
    [
        ("tag;latitude;longitude;True bearing (°)", "7;46,0;8,0;39,5", 39.5),
        ("Observer,ID,Latitude,Long,azimuth_mag,declination", "Ann,7,46.0,8.0,358,4", 2.0),
        ("id,lat,lng,bearing,declination", "7,46.0,8.0,2,-5.5", 356.5),
        ('"","id","lat","lng","true azimuth","date"', '"1","7",46.0,8.0,2,"2026-08-01"', 2.0),
    ],
)
def test_names_of_columns_are_read_without_case_and_units(
    tmp_path: Path, heading: str, row: str, bearing_deg: float
) -> None:
    (found,) = read_bearing_file(written(tmp_path / "t.csv", f"{heading}\n{row}\n"))
    assert (found.tag_id, found.tag_name) == (7, None)
    assert found.bearing_deg == pytest.approx(bearing_deg)


def test_a_magnetic_bearing_without_declination_uses_the_magnetic_model(tmp_path: Path) -> None:
    heading = "tag,lat,lon,magnetic azimuth,date"
    path = written(tmp_path / "t.csv", f"{heading}\n7,46.0,8.0,36,2026-08-01\n")
    (found,) = read_bearing_file(path)
    assert found.bearing_deg == pytest.approx(39.4, abs=0.3)  # the model has 3.4° east there
    path.write_text(f"{heading}\n7,46.0,8.0,36,\n")
    with pytest.raises(FormatError, match=r"line 2: .* needs a declination, or a date"):
        read_bearing_file(path)


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("animal,lat,lon,azimuth", "does not say from which north bearings count"),
        ("animal,easting,azimuth", "has no column latitude, longitude"),
    ],
)
def test_a_heading_that_leaves_a_doubt_is_refused_with_what_to_write(
    tmp_path: Path, heading: str, said: str
) -> None:
    path = written(tmp_path / "t.csv", f"{heading}\nF01,46.0,8.0,36\n")
    with pytest.raises(FormatError, match=f"line 1: the heading {said}"):
        read_positions(path)


def test_a_date_in_another_order_is_refused_with_an_example(tmp_path: Path) -> None:
    path = written(tmp_path / "t.csv", TABLE.replace("2026-08-01", "01.08.2026"))
    with pytest.raises(
        FormatError, match=r"line 2: 01\.08\.2026 08:00 is not a date.* such as"
    ):
        read_bearing_file(path)


def test_a_bearings_csv_with_a_heading_is_not_taken_for_a_table_by_hand(tmp_path: Path) -> None:
    heading = "tag_id,parent_file,bearing_deg,tau,lat,lon,alt_agl,alt_asl,t_start,t_end"
    row = "2,a.csv,92.5,0.9,47.4,8.5,40.0,500.0,1700000000,1700000060"
    (found,) = read_bearing_file(written(tmp_path / "bearings.csv", f"{heading}\n{row}\n"))
    assert (found.parent_file, found.observer) == ("a.csv", None)


def test_places_in_utm_need_a_zone(tmp_path: Path) -> None:
    heading = "animal,utm_x,utm_y,utm_zone,true azimuth"
    for zone, northing_m, latitude_deg in (
        ("32N", 5_094_533.6, 46.0),
        ("32s", 4_905_466.4, -46.0),
    ):
        row = f"F01,422567.8,{northing_m},{zone},39"
        path = written(tmp_path / "t.csv", f"{heading}\n{row}\n")
        (found,) = read_bearing_file(path)
        assert found.latitude_deg == pytest.approx(latitude_deg, abs=1e-3)
        assert found.longitude_deg == pytest.approx(8.0, abs=1e-3)
    for text, said in (
        (
            "animal,x,y,true azimuth\nF01,1,2,3\n",
            "line 1: eastings and northings need a column",
        ),
        ("animal,x,y,zone,true azimuth\nF01,1,2,T,3\n", "line 2: 'T' is not a UTM zone"),
    ):
        with pytest.raises(FormatError, match=said):
            read_bearing_file(written(tmp_path / "t.csv", text))


def test_animals_of_several_tables_keep_one_number_each(tmp_path: Path) -> None:
    one = written(tmp_path / "a.csv", TABLE)
    rows = TABLE.splitlines()
    other = [
        row.replace("F01", name)
        for row, name in zip(rows[1:], ("M02", "F01", "M02"), strict=True)
    ]
    two = written(tmp_path / "b.csv", "\n".join([rows[0], *other]))
    found = read_positions(one, two)
    assert [(each.tag_id, each.name) for each in found] == [(1, "F01"), (2, "M02")]
