"""What the page's server does with whole flights: it has them judged, and draws their folds."""

import base64
from pathlib import Path
from typing import Any

import made
from until import until

from uavrt.core.clock import Clock
from uavrt.flight.integrated import FlightFold, IntegratedVerdict, write_integrated
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.web.work.integration_jobs import fold_pictures

TAG = made.tag(2, 148.7e6, 1.2)


def flown(directory: Path) -> str:
    keeper = FlightKeeper(directory, Clock.start())
    flight_id = keeper.begin([TAG])
    keeper.close()
    return flight_id


def test_a_flight_without_samples_cannot_be_judged_and_the_page_is_told_why(
    served: Any,
) -> None:
    flight_id = flown(served.directory)
    path = f"/api/flights/{flight_id}/integrate"

    def judged() -> Any:
        answer = served.ask("POST", path, {})
        assert answer.status == 200
        return answer if answer.json["state"] != "working" else None

    answer = until(judged, 60.0)
    assert answer.json["state"] == "failed"
    assert "contains no samples" in answer.json["error"]
    assert "fetch them" in answer.json["error"]
    assert served.ask("GET", f"/api/flights/{flight_id}/folds").json == {}


def test_a_folded_flight_is_a_picture_of_time_and_phase(tmp_path: Path) -> None:
    verdict = IntegratedVerdict(
        tag_id=2, found=True, false_alarm_probability=1e-6, interval_s=1.2, frequency_hz=148.7e6
    )
    raster = ((0.0, 5.0, 0.0), (0.0, 4.0, 0.0))
    fold = FlightFold(
        tag_id=2, interval_s=1.2, length_s=60.0, profile=(0.0, 6.4, 0.0), raster=raster
    )
    write_integrated(tmp_path, [verdict], [], [fold])
    picture = fold_pictures(tmp_path)["2"]
    assert picture["interval_s"] == 1.2
    png = base64.b64decode(picture["picture"])
    assert png.startswith(b"\x89PNG")
    wide, high = (int.from_bytes(png[at : at + 4], "big") for at in (16, 20))
    assert (wide, high) == (12, 8)
