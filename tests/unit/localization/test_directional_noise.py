"""Noise from one direction changes a pulse's SNR, and not its energy."""

from dataclasses import replace

import made
import numpy as np
import pytest
from some import some
from turned import turned_flight

from uavrt.core.messages import Pose, PulsePose
from uavrt.localization.antenna import MONOPOLE
from uavrt.localization.estimates.flight_estimates import estimate, power_track
from uavrt.localization.estimates.heard import Heard

COUNT = 40
NOISE_DB = 12.0 * np.exp(-0.5 * ((np.arange(COUNT) - 20.0) / 4.0) ** 2)
"""Noise of a line that the flight crosses, over the receiver's own."""


def flight(noise_db: np.ndarray, *, known: bool = True, every_s: int = 2) -> Heard:
    """Fly north past a tag with regular pulses, but for three that are missed at the line."""
    found = []
    for number, over_db in enumerate(noise_db.tolist()):
        if 19 <= number <= 21:
            continue
        time_ns = 10**18 + number * every_s * 10**9
        psd = 1e-12 * 10.0 ** (over_db / 10.0) if known else float("nan")
        pulse = made.pulse(time_ns, snr_db=30.0 - over_db, noise_psd=psd)
        found.append(PulsePose(pulse=pulse, pose=made.pose(time_ns, 46.5 + 1e-4 * number)))
    poses = [one.pose for one in found if isinstance(one.pose, Pose)]
    tag = made.tag(2, made.FREQUENCY_HZ, float(every_s))
    return Heard.of_records(found, poses, tags=[tag], antenna=MONOPOLE)


def test_a_surveys_energies_are_the_same_whatever_the_noise() -> None:
    track = power_track(flight(NOISE_DB), 2)
    heard = ~np.isnan(track.snr_db)
    usual_db = float(np.median(NOISE_DB[[n for n in range(COUNT) if not 19 <= n <= 21]]))
    assert track.snr_db[heard] == pytest.approx(30.0 - usual_db, abs=1e-6)
    # A pulse is missed at the line at a level that is found elsewhere.
    limits = np.broadcast_to(track.threshold_db, heard.shape)
    assert np.count_nonzero(~heard) == 3
    assert limits[~heard].min() > limits[0] + 10.0


@pytest.mark.parametrize(
    "noise_db",
    [np.where(np.arange(COUNT) < COUNT // 2, 0.0, 12.0), np.linspace(0.0, 12.0, COUNT)],
    ids=["begins in a moment", "grows along the flight"],
)
def test_noise_that_lasts_for_half_a_flight_changes_no_energy(noise_db: np.ndarray) -> None:
    heard = flight(noise_db, every_s=10).pulses[2]
    assert np.ptp(heard.snr_db) > 10.0
    assert np.ptp(heard.snr_db + heard.noise_db) == pytest.approx(0.0, abs=1e-6)


def test_another_gain_of_the_receiver_changes_no_energy() -> None:
    """It raises noise and pulses alike, so the SNR stays."""
    gain_db = np.where(np.arange(COUNT) < COUNT // 2, 0.0, 12.0)
    heard = flight(gain_db, every_s=10).pulses[2]
    louder = replace(heard, snr_db=np.full(len(heard.snr_db), 30.0))
    assert np.ptp(10.0 * np.log10(louder.noise_psd)) == pytest.approx(12.0)
    assert louder.snr_db + louder.noise_db == pytest.approx(30.0)


def test_without_a_known_noise_the_ratio_is_taken_as_it_is() -> None:
    track = power_track(flight(NOISE_DB, known=False), 2)
    heard = ~np.isnan(track.snr_db)
    assert np.ptp(track.snr_db[heard]) > 5.0
    assert np.ptp(np.broadcast_to(track.threshold_db, heard.shape)) == 0.0


def test_a_turn_without_measured_noise_has_wider_errors_and_its_position_says_so() -> None:
    flown = turned_flight(1, turns=3)
    without = [
        replace(one, pulse=replace(one.pulse, noise_psd=float("nan")))
        for one in flown.pulse_poses
    ]
    widths, names = [], []
    for pulses in (flown.pulse_poses, without):
        heard = Heard.of_records(pulses, flown.poses, tags=flown.tags, antenna=flown.antenna)
        made_of = estimate(heard)
        widths.append(np.mean([one.bearing.sigma_deg for one in made_of.found.bearings]))
        (placed,) = made_of.positions
        names.append({one.name for one in some(placed.position).cautions})
    assert widths[1] == pytest.approx(np.hypot(widths[0], 4.0), rel=0.2)
    assert "noise" not in names[0]
    assert "noise" in names[1]
