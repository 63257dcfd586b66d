"""Any pulse survives each format; any bytes give pulses or a FormatError."""

import contextlib
import io
import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.core.errors import FormatError
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.flight.logs.detector_configs import read_detector_config
from uavrt.flight.logs.pulse_files import PulseFormat, PulseWriter, read_pulse_file
from uavrt.flight.logs.pulse_pose_log import format_line, parse_line, read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight

times = st.integers(0, 2**62 - 1)
numbers = st.floats(allow_nan=False, allow_infinity=False, width=64)
parts = st.floats(-1.0, 1.0)
poses = st.builds(
    Pose,
    time_ns=times,
    latitude_deg=st.floats(-90.0, 90.0),
    longitude_deg=st.floats(-180.0, 179.999),
    altitude_amsl_m=st.floats(-500.0, 9000.0),
    altitude_relative_m=st.floats(-500.0, 9000.0),
    quaternion_wxyz=st.tuples(parts, parts, parts, parts).filter(
        lambda q: math.hypot(*q) > 1e-5
    ),
    extrapolated=st.booleans(),
)
pulses = st.builds(
    Pulse,
    tag_id=st.integers(1, 2**32 - 1),
    frequency_hz=st.integers(20_000_000_000, 10**12).map(lambda millihertz: millihertz / 1000),
    start_time_ns=times,
    end_time_ns=times,
    snr_db=numbers,
    group_snr_db=numbers,
    score=numbers,
    group_index=st.integers(1, 100),
    group_sequence=st.integers(0, 2**40),
    noise_psd=numbers,
    detection_status=st.sampled_from(["subthreshold", "detected", "confirmed"]),
    confirmed=st.booleans(),
    rate=st.integers(1, 2),
    predicted_next_start_ns=st.none() | times,
    predicted_next_end_ns=st.none() | times,
)
pulse_poses = st.builds(PulsePose, pulse=pulses, pose=st.none() | poses)


@given(pulse_poses)
def test_a_line_of_the_log_keeps_times_exactly_and_places_to_a_millimetre(
    written: PulsePose,
) -> None:
    read = parse_line(format_line(written), group_sequence=written.pulse.group_sequence)
    status = written.pulse.detection_status
    expected = replace(
        written.pulse,
        noise_psd=math.nan,
        rate=1,
        detection_status=(
            status
            if status == "subthreshold"
            else ("confirmed" if written.pulse.confirmed else "detected")
        ),
    )
    assert repr(read.pulse) == repr(expected)  # NaN equals NaN in writing
    assert (read.pose is None) == (
        written.pose is None or all(abs(p) < 6e-10 for p in written.pose.quaternion_wxyz)
    )
    if read.pose is not None and written.pose is not None:
        assert abs(read.pose.latitude_deg - written.pose.latitude_deg) <= 6e-10
        assert abs(read.pose.longitude_deg - written.pose.longitude_deg) <= 6e-10
        assert abs(read.pose.altitude_amsl_m - written.pose.altitude_amsl_m) <= 6e-5
        for found, true in zip(
            read.pose.quaternion_wxyz, written.pose.quaternion_wxyz, strict=True
        ):
            assert abs(found - true) <= 6e-10


@given(st.lists(pulse_poses, max_size=5), st.sampled_from(["csv", "jsonl"]))
def test_pulses_survive_json_lines_and_csv_bit_by_bit(
    written: list[PulsePose], form: PulseFormat
) -> None:
    stream = io.StringIO()
    writer = PulseWriter(stream, form)
    for one in written:
        writer.write(one)
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "pulses"
        path.write_text(stream.getvalue())
        read = read_pulse_file(path)
    # The files hold no time of the pose: it is the pulse's centre, and never a guess's mark.
    expected = [
        replace(
            one,
            pose=one.pose
            and replace(
                one.pose,
                time_ns=(one.pulse.start_time_ns + one.pulse.end_time_ns) // 2,
                extrapolated=False,
            ),
        )
        for one in written
    ]
    assert list(read) == expected


@given(
    st.lists(
        pulse_poses,
        max_size=8,
        unique_by=lambda one: (one.pulse.tag_id, one.pulse.start_time_ns),
    )
)
@settings(max_examples=20)
def test_pulses_survive_the_database_bit_by_bit(written: list[PulsePose]) -> None:
    with tempfile.TemporaryDirectory() as directory:
        info = made.flight_info(
            f"{directory}/flight", start_time_ns=1, clock_offset_ns=2, center_frequency_hz=1.5e8
        )
        made.flight(info, pulse_poses=written)
        read = read_flight(info.directory).pulse_poses
    key = lambda one: (one.pulse.start_time_ns, one.pulse.tag_id)  # noqa: E731
    assert list(read) == sorted(written, key=key)


SOUP = st.one_of(
    st.binary(),
    st.text(alphabet='0123456789,. naif-+\n\t:#{}[]"IDtpFs\0é٢', max_size=200).map(str.encode),
    st.lists(st.sampled_from(["nan", "0", "1", "-1", "1e999", "x", ""]), max_size=46).map(
        lambda cells: (", ".join(cells) + "\n").encode()
    ),
)


@given(SOUP, st.sampled_from([read_pulse_pose_log, read_pulse_file, read_detector_config]))
@settings(max_examples=100)
def test_any_bytes_are_read_or_refused_by_name(
    content: bytes, read: Callable[[Path], object]
) -> None:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "a file"
        path.write_bytes(content)
        with contextlib.suppress(FormatError):
            read(path)
