"""Any text gives records or a FormatError, in every format; what is written is read back."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from uavrt.core.errors import FormatError
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.formats.bearings_csv import read_bearing_file
from uavrt.formats.positions_csv import read_position_file
from uavrt.formats.pulses.pyradiotracking import read_pyradiotracking
from uavrt.formats.pulses.tagtracker import read_tagtracker
from uavrt.formats.pulses.ucsd import read_ucsd_estimates, read_ucsd_pings

cells = st.one_of(
    st.sampled_from(["7", "10", "11", "20", "nan", "-inf", "-9999", "1e400", "", "0", "1"]),
    st.integers(-(2**70), 2**70).map(str),
    st.floats().map(repr),
    st.text(max_size=6),
)
headings = st.sampled_from(
    [
        "",
        "# 7, orientation_x, noise_psd, antenna_offset, a, b, c, d, e, f, g, h, i, j, k",
        "Run,Timestamp,Frequency,Amplitude,Easting,Northing,Altitude,Heading,EPSG Code",
        "Run,Timestamp,Frequency,Easting,Northing,EPSG Code",
        "Device;Time;Frequency;Duration;max (dBW);avg (dBW);std (dB);noise (dBW);snr (dB)",
        "tag_id,frequency_hz,start_time_ns",
    ]
)
columns = st.sampled_from([4, 6, 8, 9, 10, 19, 20, 21, 23]) | st.integers(0, 30)
rows = columns.flatmap(lambda n: st.lists(cells, min_size=n, max_size=n))
texts = st.builds(
    lambda heading, lines, separator: "\n".join(
        [heading, *(separator.join(line) for line in lines)]
    ),
    headings,
    st.lists(rows, max_size=5),
    st.sampled_from([",", ", ", ";"]),
)
READERS: list[Callable[[Path], object]] = [
    read_pulse_log,
    read_tagtracker,
    read_ucsd_pings,
    read_ucsd_estimates,
    read_pyradiotracking,
    read_bearing_file,
    read_position_file,
]


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__name__)
@given(text=texts | st.text(), tail=st.binary(max_size=20))
@example(text="7,1,2,9e18,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1", tail=b"")
@example(text="tag_id,frequency_hz,start_time_ns\n7,7,\r0\n7", tail=b"")
@example(text="tag_id,frequency_hz\n" + "7" * 200_000, tail=b"\n")
@example(text="\n-inf,7,7,7,7,7,7,7,7,7", tail=b"")
@settings(max_examples=25)
def test_any_text_gives_records_or_a_format_error(
    reader: Callable[[Path], object], text: str, tail: bytes
) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "log.csv"
        path.write_bytes(text.encode("utf-8", "surrogatepass") + tail)
        fault = fault_of(reader, path)
    assert fault is None or str(path) in fault


def fault_of(reader: Callable[[Path], object], path: Path) -> str | None:
    try:
        reader(path)
    except FormatError as error:
        return str(error)
    return None
