"""Recorded flights for the tests of reports and exports: true pulses of a simulated world."""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import made
import numpy as np
import pytest

from uavrt.config.settings import Settings
from uavrt.core.messages import Health, Pose, Poses, PulsePose, StatusText
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.world import TruePulse, World

WriteFlight = Callable[..., Path]
STATIONS_M = ((0.0, 0.0), (250.0, 0.0), (250.0, 250.0))


def survey_scenario(tags: int = 2) -> Scenario:
    """Turns in place at three points."""
    legs = []
    for north, east in STATIONS_M:
        legs += [
            Leg(duration_s=30.0, north_m=north, east_m=east, height_m=40.0),
            Leg(duration_s=50.0, turn_deg=360.0),
        ]
    return Scenario(
        name="survey",
        seed=7,
        duration_s=240.0,
        flight=Flight(leg=tuple(legs)),
        tag=tuple(
            made.simulated_tag(
                2 + number,
                148.71e6 + 25e3 * number,
                name="Kiwi & <Chick>" if number == 0 else None,
                north_m=120.0 + 60 * number,
                east_m=420.0 - 150 * number,
                erp_dbm=-38.0,
            )
            for number in range(tags)
        ),
    )


@cache
def flown(scenario: Scenario) -> Poses:
    """The vehicle's poses, ten a second."""
    end_ns = scenario.start_time_ns + round(scenario.duration_s * 1e9)
    times = range(scenario.start_time_ns, end_ns, 100_000_000)
    return Poses(poses=tuple(map(scenario.vehicle_pose, times)))


@cache
def sent(scenario: Scenario) -> list[tuple[TruePulse, Pose]]:
    """True pulses, each with the antenna's pose in its middle."""
    start_ns = scenario.start_time_ns
    end_ns = start_ns + round(scenario.duration_s * 1e9)
    return [
        (one, scenario.antenna_pose((one.start_time_ns + one.end_time_ns) // 2))
        for one in World(scenario).truth(start_ns, end_ns)
    ]


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let reports have the names of their pictures in place of the pictures."""
    page = "uavrt.analysis.report.report_page._picture"
    monkeypatch.setattr(page, lambda picture: picture.name)


@pytest.fixture(scope="session")
def scenario_of() -> Callable[[int], Scenario]:
    """The world of the flights, by its number of tags."""
    return survey_scenario


@pytest.fixture(scope="session")
def write_flight(tmp_path_factory: pytest.TempPathFactory) -> WriteFlight:
    """Write a flight directory; tags beyond `heard` are listed and never heard."""

    def write(
        *,
        tags: int = 2,
        heard: int = 1,
        poses: bool = True,
        name: str = "flight_log_x",
        scenario: Scenario | None = None,
        settings: Settings | None = None,
    ) -> Path:
        scenario = scenario or survey_scenario(tags)
        end_ns = scenario.start_time_ns + round(scenario.duration_s * 1e9)
        directory = tmp_path_factory.mktemp("flights") / name
        recorder = FlightRecorder.create(
            made.flight_info(directory, scenario.tags, start_time_ns=scenario.start_time_ns),
            settings,
        )
        times = range(scenario.start_time_ns, end_ns, 100_000_000)
        if poses:
            recorder.write(*flown(scenario).poses)
        rng = np.random.default_rng(3)
        for truth, pose in sent(scenario):
            snr_db = truth.enr_db + float(rng.normal(0.0, 1.0))
            if truth.tag_id >= 2 + heard or snr_db < 10.0:
                continue
            pulse = made.pulse(
                truth.start_time_ns,
                tag_id=truth.tag_id,
                frequency_hz=truth.frequency_hz,
                end_time_ns=truth.end_time_ns,
                snr_db=snr_db,
                group_index=1 + truth.pulse_index % 3,
                group_sequence=truth.pulse_index // 3,
                predicted_next_start_ns=truth.start_time_ns + 1_254_000_000,
                predicted_next_end_ns=truth.end_time_ns + 1_254_000_000,
            )
            recorder.write_pulses([PulsePose(pulse=pulse, pose=pose if poses else None)])
        for second, time_ns in enumerate(times[::10]):
            counters = {"samples_lost": float(second // 100)}
            for process in ("receiver", "detector_1"):
                recorder.write(
                    Health(
                        process=process,
                        time_ns=time_ns,
                        status="ready",
                        ok=second != 50,
                        counters=counters,
                    )
                )
            recorder.write(
                made.search_report(
                    1 + tags, time_ns, noise_psd=1e-12 * math.exp(second / 300), best_score=0.4
                )
            )
        recorder.write_status_text(StatusText(severity=4, text="samples lost <12>"), times[99])
        recorder.write_note("battery changed", times[5])
        recorder.commit()
        recorder.close()
        return directory

    return write
