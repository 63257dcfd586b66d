"""What other programs recorded is judged as well: arrays in Python, recordings with a track."""

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Ran
from tests.unit.whole_flight.conftest import RATE_HZ, WINDOW_HZ, Rotation, rotation

from uavrt.analysis.integrated.integrated_samples import integrate
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.errors import RecordingError, UsageError
from uavrt.localization.angles import difference_deg
from uavrt_experiments.detection.signals import START_NS

pytestmark = pytest.mark.slow

FIXED = [
    *("tag_id", "found", "false_alarm_probability", "enr_db", "interval_s", "frequency_hz"),
    *("pulses", "latitude_deg", "longitude_deg", "radius50_m", "radius95_m"),
]
"""Names that programs outside of this project read."""


def judged(flown: Rotation, antenna: str = "RA-23K", **other: Any) -> Any:
    """Judge a rotation in Python, by other samples or poses if they are given."""
    usual: dict[str, Any] = {
        "samples": flown.samples,
        "poses": flown.flight.poses,
        "center_frequency_hz": flown.tag.frequency_hz,
        "frequency_window_hz": WINDOW_HZ,
    }
    usual |= {"time_ns": START_NS, "sample_rate_hz": RATE_HZ}
    given = usual | other
    samples, poses = given.pop("samples"), given.pop("poses")
    return integrate(samples, poses, flown.tag, antenna, **given)


def test_samples_and_poses_in_python_are_judged_as_by_the_command(weak: Rotation) -> None:
    found = judged(weak)
    assert found.found
    assert (found.tag_id, found.antenna, found.antenna_assumed) == (2, "RA-23K", False)
    assert found.interval_s == pytest.approx(weak.interval_s, abs=2e-4)
    assert found.enr_db == pytest.approx(6.0, abs=2.5)
    assert abs(difference_deg(found.bearing_deg, weak.bearing_deg)) < 20.0
    assert found.pulses == len(found.integrated_pulses) == pytest.approx(160, abs=6)
    assert all(text.startswith("the position assumes") for text in found.limitations)
    assert set(FIXED) <= set(asdict(found))
    with pytest.raises(UsageError, match="no antenna 'made-up'"):
        judged(weak, "made-up")


def test_lost_samples_in_python_are_a_limitation_and_no_zeros(weak: Rotation) -> None:
    samples = weak.samples.copy()
    samples[len(samples) // 2 :] = np.nan
    found = judged(weak, samples=samples)
    assert any("samples exist for only 50% of the flight" in text for text in found.limitations)
    half_ns = START_NS + round(0.5e9 * len(samples) / RATE_HZ)
    assert all(one.time_ns < half_ns for one in found.integrated_pulses)


def test_a_window_wider_than_the_channel_is_told_as_what_was_searched() -> None:
    """5000 Hz were said to be searched, of a channel that holds 1875 on either side."""
    short = rotation(3, 6.0, pulses=30)
    beside_hz = short.tag.frequency_hz + 200.0
    found = judged(short, center_frequency_hz=beside_hz, frequency_window_hz=5000.0)
    assert any("only ± 1675 Hz around" in text for text in found.limitations)


def test_a_dead_radio_is_no_silence_of_the_tag(weak: Rotation) -> None:
    """Zeros were taken for a flight that heard no tag, and the map said where it is not."""
    with pytest.raises(RecordingError, match="all samples of tag 2's channel are 0"):
        judged(weak, samples=np.zeros_like(weak.samples))
    samples = weak.samples.copy()
    samples[len(samples) // 2 :] = 0.0
    found = judged(weak, samples=samples)
    assert any("samples exist for only 50% of the flight" in text for text in found.limitations)
    lost = weak.samples.copy()
    lost[len(samples) // 2 :] = np.nan
    assert found.score == pytest.approx(judged(weak, samples=lost).score, abs=0.2)


def test_what_was_heard_without_a_pose_counts_nothing(weak: Rotation) -> None:
    half_ns = START_NS + round(0.5e9 * len(weak.samples) / RATE_HZ)
    before = tuple(one for one in weak.flight.poses if one.time_ns < half_ns)
    found = judged(weak, poses=before)
    assert any(
        "of the samples have no pose within 2 s and are left out" in text
        for text in found.limitations
    )
    # As if nobody had listened then, 2 s after the last pose on.
    samples = weak.samples.copy()
    samples[round((before[-1].time_ns - START_NS) * 1e-9 * RATE_HZ + 2.0 * RATE_HZ) :] = np.nan
    deaf = judged(weak, samples=samples, poses=before)
    assert found.interval_s == pytest.approx(deaf.interval_s, abs=1e-3)
    assert found.score == pytest.approx(deaf.score, abs=0.5)
    assert all(one.time_ns < half_ns + 3e9 for one in found.integrated_pulses)


@pytest.fixture
def recorded(weak: Rotation, tmp_path: Path) -> list[str]:
    """A recording, the autopilot's track on a clock 40 s behind, and a list of tags."""
    samples, track, tags = tmp_path / "x.cf32", tmp_path / "track.csv", tmp_path / "tags.toml"
    weak.samples.tofile(samples)
    names = "time_ns,latitude_deg,longitude_deg,altitude_amsl_m,altitude_relative_m,qw,qx,qy,qz"
    lines = [
        ",".join(
            map(
                repr,
                (
                    *(one.time_ns - 40_000_000_000, one.latitude_deg, one.longitude_deg),
                    *(one.altitude_amsl_m, one.altitude_relative_m, *one.quaternion_wxyz),
                ),
            )
        )
        for one in weak.flight.poses
    ]
    track.write_text("\n".join((names, *lines)) + "\n")
    write_tags(tags, [weak.tag])
    return [
        *("integrate", "--recording", str(samples), "--track", str(track)),
        *("--tags", str(tags), "--sample-rate", str(RATE_HZ), "--start-time"),
        *("2023-11-14T22:13:20Z", "--center-frequency", str(weak.tag.frequency_hz)),
        *("--frequency-window", str(WINDOW_HZ), "--json"),
    ]


KNOWN = ("--clock-offset", 40, "--antenna", "RA-23K")


@pytest.fixture
def noise(recorded: list[str], weak: Rotation) -> np.ndarray:
    """Noise alone in place of the recording."""
    noise = np.random.default_rng(3).normal(size=(len(weak.samples), 2)).astype(np.float32)
    noise.tofile(recorded[2])
    return noise


def test_a_recording_with_a_track_is_judged_without_a_flight(
    recorded: list[str], weak: Rotation, ran: Ran
) -> None:
    (said,) = ran(*recorded, *KNOWN).json
    assert said["found"]
    assert not said["antenna_assumed"]
    (rest,) = said["limitations"]
    assert rest.startswith("the position assumes that the tag was at rest")
    assert abs(difference_deg(said["bearing_deg"], weak.bearing_deg)) < 20.0
    assert set(FIXED) <= set(said)
    (said,) = ran(*recorded, *KNOWN, "--yaw-offset", 90).json
    assert abs(difference_deg(said["bearing_deg"], weak.bearing_deg + 90.0)) < 20.0


def test_a_recording_that_was_cut_off_is_judged_as_far_as_it_goes(
    recorded: list[str], weak: Rotation, ran: Ran
) -> None:
    """As by a power cut: nothing was judged, and it said that all samples were used."""
    samples = Path(recorded[2])
    samples.write_bytes(samples.read_bytes()[: 7 * weak.samples.nbytes // 10 // 8 * 8 + 5])
    (said,) = ran(*recorded, *KNOWN).json
    told = " ".join(said["limitations"])
    assert "only the samples before this fault were searched" in told
    end_ns = START_NS + round(0.7e9 * len(weak.samples) / RATE_HZ)
    assert all(one["time_ns"] < end_ns for one in said["integrated_pulses"] or [])


@pytest.mark.usefixtures("noise")
def test_silence_names_the_noise_that_it_is_told_by(recorded: list[str], ran: Ran) -> None:
    """Of a recording with a track nobody knows the drone's noise: it was said in JSON alone."""
    with_words = [one for one in recorded if one != "--json"]
    said = ran(*with_words, *KNOWN, ends=1).words
    assert "not found" in said
    assert (
        "the map: noise of the drone: unknown, only the radio's own is used: "
        "the noise level is unknown, because a vehicle's track contains no noise "
        "measurements" in said
    )


@pytest.mark.usefixtures("noise")
def test_silence_of_a_recording_with_a_track_is_that_of_the_search_made(
    recorded: list[str], ran: Ran
) -> None:
    """It was told of detectors' groups in 500 Hz, and no detector had been there."""
    (said,) = ran(*recorded, *KNOWN, ends=1).json
    assert said["silence"]["whole_flight"]
    told = " ".join(said["silence"]["limitations"])
    assert "the result covers tags within 150 Hz of their listed frequency" in told
    assert "detectors" not in told


def test_a_radio_that_was_mostly_dead_finds_no_tag_silent(
    recorded: list[str], noise: np.ndarray, ran: Ran
) -> None:
    """Where no second was half heard, the map took all of the flight for listened to."""
    noise[np.arange(len(noise)) % 3750 > 1000] = 0.0
    noise.tofile(recorded[2])
    (said,) = ran(*recorded, *KNOWN, ends=1).json
    assert (
        "samples exist for only 0% of the flight, and the rest was not searched"
        in (said["limitations"])
    )
    assert said["silence"]["sure_within_m"] is None
    assert said["silence"]["share50"] == 0.0


def test_what_nobody_told_of_a_recording_is_a_limitation(recorded: list[str], ran: Ran) -> None:
    (said,) = ran(*recorded).json
    assert said["antenna"] == "RA-23K"
    assert said["antenna_assumed"]
    told = " ".join(said["limitations"])
    assert "antenna not specified" in told
    assert "clocks of recording and track are taken to agree" in told
    assert "samples have no pose" in told


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ((lambda a, d: [*a[:1], str(d), *a[1:]]), "has its own poses"),
        ((lambda a, d: [*a[:5], *a[7:]]), "--track needs --tags"),
        ((lambda a, d: [*a[:3], *a[5:]]), "no flight was given"),
        ((lambda a, d: [*a[:1], a[4], *a[1:3], *a[5:]]), "not the directory of a flight"),
    ],
)
def test_a_recording_that_lacks_something_is_told_what(  # type: ignore[no-untyped-def]
    recorded: list[str], tmp_path: Path, ran: Ran, change, fault: str
) -> None:
    assert fault in ran(*change(recorded, tmp_path), ends=2).words


def test_a_whip_is_deaf_overhead_and_tells_no_direction(weak: Rotation) -> None:
    from uavrt.localization.antenna import monopole_gain_db, pattern_named
    from uavrt.localization.estimates.heard import PoseColumns
    from uavrt.localization.whole_flight.tag_places import places_around

    poses = tuple(replace(one, altitude_relative_m=50.0) for one in weak.flight.poses)
    places = places_around(
        PoseColumns.of(poses),
        pattern_named("monopole"),
        start_ns=START_NS,
        end_ns=poses[-1].time_ns,
    )
    range_m = np.array([30.0, 3000.0])
    gain_db = places.track.gain_db(range_m, np.zeros(2))
    assert np.ptp(gain_db, axis=1) == pytest.approx([0.0, 0.0], abs=1e-9)
    down = np.degrees(np.arctan2(50.0, range_m))
    away_db = 25.0 * np.log10(np.hypot(50.0, range_m))
    expected = monopole_gain_db(down) - away_db
    assert gain_db[:, 0] == pytest.approx(expected, abs=0.01)
    assert math.isclose(float(monopole_gain_db(down)[0]), -5.8, abs_tol=0.3)
