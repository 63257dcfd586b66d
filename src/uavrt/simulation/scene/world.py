"""Compute the true pulses of a scenario, each with its time, frequency and level."""

import bisect
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.antenna_switch import AntennaSwitch, position_weights
from uavrt.simulation.scene.counter_random import stream_key, uniform
from uavrt.simulation.scene.flown_path import FlownPath
from uavrt.simulation.scene.propagation import (
    SPEED_OF_LIGHT_M_S,
    Link,
    fading_db,
    link,
    water_loss_db,
)
from uavrt.simulation.scene.relief import Heights, Relief
from uavrt.simulation.scene.scenario import Scenario, SimulatedTag

THERMAL_NOISE_DBM_HZ = -173.975
"""Thermal noise power density at 290 K [dBm/Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TruePulse:
    """A pulse as the tag sent it, to be compared with detected pulses."""

    tag_id: int
    listed: bool
    """False for a tag in the area that the operator does not search for."""
    pulse_index: int
    """Number of the tag's pulse since the start of the scenario, from 0."""
    rate: int
    """Number of the interval that follows this pulse: 1 or 2, in the order of the tag list."""
    transmit_time_ns: int
    start_time_ns: int
    """Start of the pulse at the antenna [ns, UTC]."""
    end_time_ns: int
    frequency_hz: float
    """Received carrier frequency [Hz], with the tag's error, drift and Doppler shift."""
    received_power_dbm: float
    enr_db: float
    """Ratio of pulse energy to noise power density [dB]."""
    amplitude: float
    """Amplitude of the complex samples at the radio's gain [full scale]."""
    phase_rad: float
    fading_db: float
    distance_m: float
    bearing_deg: float
    """Compass direction from the antenna to the tag, true [°]."""
    elevation_deg: float
    off_boresight_deg: float


def noise_psd_dbm_hz(scenario: Scenario) -> float:
    """Noise power density at the antenna connector [dBm/Hz]."""
    return THERMAL_NOISE_DBM_HZ + scenario.radio.noise_figure_db


def full_scale_factor(scenario: Scenario, gain: int | None = None) -> float:
    """Amplitude of the samples [full scale] for 1 mW at the antenna connector.

    The level of the noise in the samples gives the scale: a wave of power P has the amplitude
    noise_rms·√(P / (N₀·fs)) at any sample rate.
    """
    radio = scenario.radio
    noise_mw = 10.0 ** (noise_psd_dbm_hz(scenario) / 10.0) * radio.sample_rate_hz
    steps = (radio.gain if gain is None else gain) - 21
    gain_ratio = math.pow(10.0, steps * radio.gain_step_db / 20.0)
    return radio.noise_rms / math.sqrt(noise_mw) * gain_ratio


class World:
    """All pulses of a scenario; they depend only on the scenario and the drone's path."""

    def __init__(
        self,
        scenario: Scenario,
        path: FlownPath | None = None,
        *,
        ground: Heights | None = None,
    ) -> None:
        self.scenario = scenario
        self._relief = (
            Relief.of_files(scenario.terrain, scenario.plane)
            if ground is None
            else Relief(ground)
        )
        self._path = path
        self._trains = {tag.tag_id: _PulseTrain(scenario, tag) for tag in scenario.tag}
        self._noise_dbm_hz = noise_psd_dbm_hz(scenario)
        self._full_scale = full_scale_factor(scenario)

    def truth(self, start_time_ns: int, end_time_ns: int) -> list[TruePulse]:
        """Get all pulses that start at the antenna in [start, end), in order of time."""
        found: list[TruePulse] = []
        # 1 ms covers the way of light over 300 km.
        first_s = self.scenario.elapsed_s(start_time_ns) - 1e-3
        last_s = self.scenario.elapsed_s(end_time_ns)
        for tag in self.scenario.tag:
            for index in self._trains[tag.tag_id].indices(first_s, last_s):
                pulse = self.pulse(tag, index)
                if start_time_ns <= pulse.start_time_ns < end_time_ns:
                    found.append(pulse)
        return sorted(found, key=lambda pulse: pulse.start_time_ns)

    def pulse_indices(self, tag: SimulatedTag, start_s: float, end_s: float) -> range:
        """Indices of a tag's pulses that start at the tag in [start, end) [s]."""
        return self._trains[tag.tag_id].indices(start_s, end_s)

    def pulse(self, tag: SimulatedTag, index: int) -> TruePulse:
        """Compute one pulse of a tag."""
        scenario = self.scenario
        elapsed_s, rate = self._trains[tag.tag_id].at(index)
        transmit_ns = scenario.start_time_ns + round(elapsed_s * 1e9)
        way = self._link(tag, transmit_ns)
        fade_db = fading_db(scenario.propagation.fading, scenario.seed, tag.tag_id, elapsed_s)
        power_dbm = (
            tag.erp_dbm
            - tag.extra_loss_db
            - water_loss_db(tag.water_depth_m, tag.water_conductivity_s_m)
            + way.gain_db
            + fade_db
        )
        width_s = tag.true_pulse_width_s or tag.pulse_width_s
        start_ns = transmit_ns + round(way.distance_m / SPEED_OF_LIGHT_M_S * 1e9)
        turns = uniform(stream_key(scenario.seed, "phase", tag.tag_id), index)
        return TruePulse(
            tag_id=tag.tag_id,
            listed=tag.listed,
            pulse_index=index,
            rate=rate,
            transmit_time_ns=transmit_ns,
            start_time_ns=start_ns,
            end_time_ns=start_ns + round(width_s * 1e9),
            frequency_hz=self._frequency_hz(tag, transmit_ns),
            received_power_dbm=power_dbm,
            enr_db=power_dbm - self._noise_dbm_hz + 10.0 * math.log10(width_s),
            amplitude=10.0 ** (power_dbm / 20.0) * self._full_scale,
            phase_rad=2 * math.pi * float(turns),
            fading_db=fade_db,
            distance_m=way.distance_m,
            bearing_deg=way.bearing_deg,
            elevation_deg=way.elevation_deg,
            off_boresight_deg=way.off_boresight_deg,
        )

    def antenna_state(self, time_ns: int) -> tuple[geometry.Vector, geometry.Quaternion]:
        """Position from home [m, NED] and attitude of the antenna at a time [ns, UTC]."""
        state = None if self._path is None else self._path.state(time_ns)
        if state is None:
            return self.scenario.antenna_state(time_ns)
        return self.scenario.antenna_on(state)

    def position_weights(
        self, switch: AntennaSwitch, pulse: TruePulse
    ) -> NDArray[np.complex128]:
        """Complex amplitudes of a pulse at each position of an antenna switch, (positions,)."""
        tag = next(one for one in self.scenario.tag if one.tag_id == pulse.tag_id)
        place, rotation = self.antenna_state(pulse.start_time_ns)
        there = self._tag_place(tag, pulse.start_time_ns)
        ray = geometry.subtract(there, place)
        direction = geometry.scale(ray, 1.0 / max(geometry.length(ray), 1e-9))
        body = geometry.unrotate(rotation, direction)
        return position_weights(switch, body, SPEED_OF_LIGHT_M_S / pulse.frequency_hz)

    def _tag_place(self, tag: SimulatedTag, time_ns: int) -> geometry.Vector:
        north, east, down = self.scenario.tag_position_ned_m(tag, time_ns)
        if self._relief is None:
            return north, east, down
        return north, east, down - self._relief.height_m(north, east)

    def _link(self, tag: SimulatedTag, time_ns: int) -> Link:
        place, rotation = self.antenna_state(time_ns)
        there = self._tag_place(tag, time_ns)
        heights = None
        if self._relief is not None:
            beneath = self._relief.height_m(place[0], place[1])
            heights = (max(-place[2] - beneath, 0.1), max(tag.height_m, 0.1))
        found = link(
            self.scenario.propagation,
            self.scenario.antenna,
            tag_ned_m=there,
            antenna_ned_m=place,
            antenna_quaternion_wxyz=rotation,
            polarization_deg=tag.polarization_deg,
            frequency_hz=tag.frequency_hz,
            heights_m=heights,
        )
        if self._relief is None:
            return found
        loss_db = self._relief.loss_db(place, there, SPEED_OF_LIGHT_M_S / tag.frequency_hz)
        return replace(found, gain_db=found.gain_db - loss_db)

    def _frequency_hz(self, tag: SimulatedTag, time_ns: int) -> float:
        elapsed_s = self.scenario.elapsed_s(time_ns)
        sent = (
            tag.frequency_hz * (1.0 + tag.frequency_offset_ppm * 1e-6)
            + tag.frequency_offset_hz
            + tag.frequency_drift_hz_s * elapsed_s
        )
        if not self.scenario.propagation.doppler:
            return sent
        # The change of distance over 2 ms, about the pulse's start, is the closing speed.
        before, after = (
            math.dist(self._tag_place(tag, moment), self.antenna_state(moment)[0])
            for moment in (time_ns - 1_000_000, time_ns + 1_000_000)
        )
        return sent * (1.0 - (after - before) / 2e-3 / SPEED_OF_LIGHT_M_S)


class _PulseTrain:
    """Start times of one tag's pulses when they leave the tag, computed on demand."""

    def __init__(self, scenario: Scenario, tag: SimulatedTag) -> None:
        self._tag = tag
        self._jitter_key = stream_key(scenario.seed, "jitter", tag.tag_id)
        self._steps_s = tag.gaps_s
        self._grid_s = [tag.first_pulse_s]
        self._rates = [self._rate(0, tag.first_pulse_s)]

    def _rate(self, index: int, elapsed_s: float) -> int:
        tag = self._tag
        if len(tag.pulse_intervals_s) == 1:
            return 1
        if tag.rate_pattern:
            return tag.rate_pattern[index % len(tag.rate_pattern)]
        return 1 + sum(switch <= elapsed_s for switch in tag.rate_switches_s) % 2

    def _extend(self, end_s: float) -> None:
        tag = self._tag
        while self._grid_s[-1] < end_s + tag.jitter_s:
            interval = tag.pulse_intervals_s[self._rates[-1] - 1] + tag.interval_error_s
            if self._steps_s:
                # The gaps of a burst, then the rest of the time to the next.
                place = (len(self._grid_s) - 1) % (len(self._steps_s) + 1)
                left = interval - sum(self._steps_s)
                interval = left if place == len(self._steps_s) else self._steps_s[place]
            interval *= 1.0 + 1e-6 * tag.crystal_error_ppm
            self._grid_s.append(self._grid_s[-1] + interval)
            self._rates.append(self._rate(len(self._rates), self._grid_s[-1]))

    def indices(self, start_s: float, end_s: float) -> range:
        """Indices of the pulses that start in [start, end)."""
        self._extend(end_s)
        jitter = self._tag.jitter_s
        first = bisect.bisect_left(self._grid_s, start_s - jitter)
        last = bisect.bisect_right(self._grid_s, end_s + jitter)
        if jitter > 0.0:
            while first < last and self.at(first)[0] < start_s:
                first += 1
            while last > first and self.at(last - 1)[0] >= end_s:
                last -= 1
        else:
            last = bisect.bisect_left(self._grid_s, end_s)
        return range(first, last)

    def at(self, index: int) -> tuple[float, int]:
        """Start [s after the scenario's start] and rate of a pulse."""
        jitter = 0.0
        if self._tag.jitter_s > 0.0:
            jitter = self._tag.jitter_s * (2.0 * float(uniform(self._jitter_key, index)) - 1.0)
        if index >= len(self._grid_s):
            self._extend(self._grid_s[-1] + 1.0)
            return self.at(index)
        return self._grid_s[index] + jitter, self._rates[index]
