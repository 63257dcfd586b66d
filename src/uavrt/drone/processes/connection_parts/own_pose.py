"""Position and heading of a station without autopilot, from the settings or a GPS receiver.

A mast has a measured position and heading in the settings. A person or cart has a GPS receiver
that speaks NMEA or gpsd; the heading comes from a compass or is typed while moving.
"""

import asyncio
from collections import Counter
from collections.abc import Callable

from uavrt.config.settings import PoseSettings
from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.errors import ConfigError, UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.core.units import ns_from_s, wrap_degrees_360
from uavrt.formats.gpsd import WATCH, GpsdParser, GpsdReport
from uavrt.formats.nmea import BAUD, Sentence, SentenceParser
from uavrt.link.mavlink.links.address import Address, parse_address
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import keep_open

log = get_logger()

FIXED_PERIOD_S = 0.5
"""Time between two poses of a fixed station [s]; poses are interpolated."""
CLOSEST_NS = ns_from_s(0.02)
"""Shortest time between two used GPS positions [ns]; 1 to 20 arrive a second."""
SILENCE_NS = ns_from_s(5.0)
"""Age from which a GPS position is too old to use [ns]; receivers send at least one a
second."""
ALTITUDE_HOLDS_NS = ns_from_s(3.0)
"""Time after a position with altitude in which those without are dropped [ns]."""
WATCH_PERIOD_S = 3.0
"""Time between data requests to a silent gpsd [s], which needs a new one after a restart."""
GPSD = "127.0.0.1:2947"
WAIT_S = 1.5
"""Longest time that a pulse waits for the GPS receiver's next position [s]."""


def pose_address(settings: PoseSettings) -> Address | None:
    """Return the GPS receiver's address, or None for a fixed station.

    Raises `ConfigError` if the settings lack or contradict it.
    """
    if settings.source == "fixed":
        missing = [
            name
            for name in ("latitude_deg", "longitude_deg", "heading_deg")
            if getattr(settings, name) is None
        ]
        if missing:
            raise ConfigError(
                f"a fixed station needs {', '.join(missing)}",
                remedy="Set these values in [pose] of the settings; for an "
                "omnidirectional antenna, set heading_deg = 0",
            )
        return None
    if settings.source == "gpsd":
        try:
            return parse_address(f"tcp://{settings.address or GPSD}")
        except ConfigError as error:
            raise ConfigError(
                f"pose.address {settings.address!r} is not HOST:PORT",
                remedy=f"Set the address of gpsd, such as {GPSD}, or leave it empty",
            ) from error
    if not settings.address:
        raise ConfigError(
            'pose.source = "nmea" needs pose.address',
            remedy="Set it to serial:///dev/ttyACM0:9600, or udpin://0.0.0.0:10110 for a phone",
        )
    return parse_address(settings.address, baud=BAUD)


class OwnPose:
    """Produces attitude and position samples from settings or a GPS receiver."""

    def __init__(
        self,
        settings: PoseSettings,
        clock_ns: Callable[[], int],
        *,
        attitude: Callable[[AttitudeSample], None],
        position: Callable[[PositionSample], None],
    ) -> None:
        self._settings, self._clock_ns = settings, clock_ns
        self._address = pose_address(settings)
        self._give_attitude, self._give_position = attitude, position
        self._link: Link | None = None
        self._fault: str | None = None
        self._place_ns: int | None = None
        self._heading_ns: int | None = None
        self._altitude_ns: int | None = None
        self.counters: Counter[str] = Counter()
        """Numbers of GPS positions and headings used and dropped, by name."""

    def use(self, settings: PoseSettings) -> None:
        """Apply changed settings, such as a newly typed heading."""
        self._settings = settings

    @property
    def status(self) -> str | None:
        """Return a text on the missing position or heading; None if both are known."""
        now_ns = self._clock_ns()
        if self._fault is not None:
            return f"no position: {self._fault}"
        if self._place_ns is None or now_ns - self._place_ns > SILENCE_NS:
            return "waiting for a position"
        if self._heading_ns is None or now_ns - self._heading_ns > SILENCE_NS:
            return "waiting for a heading: no compass, and pose.heading_deg is not set"
        return None

    def health(self) -> dict[str, float]:
        """Counts of positions, headings and bytes, for the health report."""
        counts = {f"pose_{name}": float(count) for name, count in self.counters.items()}
        if self._link is not None:
            link = self._link.counters
            counts |= {"pose_refused": link.bad_crc, "pose_skipped_bytes": link.skipped_bytes}
        return counts

    async def run(self) -> None:
        """Produce attitude and position samples until cancelled."""
        if self._address is None:
            await self._report_fixed_place()
        elif self._settings.source == "gpsd":
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._read(self._address, self.take_report, GpsdParser()))
                tasks.create_task(self._request_reports())
        else:
            await self._read(self._address, self.take_sentence, SentenceParser())

    def take_sentence(self, sentence: Sentence) -> None:
        """Use the heading and position of an NMEA sentence."""
        heading_deg, place = sentence.heading_deg, sentence.place
        if heading_deg is not None:
            self._heading(heading_deg)
        if place is not None:
            self._place(*place, sentence.altitude_amsl_m)

    def take_report(self, report: GpsdReport) -> None:
        """Use the heading and position of a gpsd report."""
        if report.heading_deg is not None:
            self._heading(report.heading_deg)
        if report.place is not None:
            self._place(*report.place, report.altitude_amsl_m)

    def _place(
        self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float | None
    ) -> None:
        now_ns = self._clock_ns()
        altitude_ns = self._altitude_ns
        if altitude_amsl_m is not None:
            self._altitude_ns = now_ns
        elif altitude_ns is not None and now_ns - altitude_ns < ALTITUDE_HOLDS_NS:
            self.counters["places_without_altitude"] += 1
            return
        if self._place_ns is not None and 0 <= now_ns - self._place_ns < CLOSEST_NS:
            self.counters["places_too_often"] += 1
            return
        settings = self._settings
        self._place_ns = now_ns
        self.counters["places"] += 1
        if altitude_amsl_m is None:
            altitude_amsl_m = settings.altitude_amsl_m + settings.height_m
        self._give_position(
            PositionSample(
                time_ns=now_ns,
                latitude_deg=latitude_deg,
                longitude_deg=longitude_deg,
                altitude_amsl_m=altitude_amsl_m,
                altitude_relative_m=settings.height_m,
            )
        )
        if settings.heading_deg is not None:
            self._use_heading(settings.heading_deg, now_ns)

    def _heading(self, heading_deg: float) -> None:
        now_ns = self._clock_ns()
        if self._settings.heading_deg is not None:
            self.counters["compass_passed_over"] += 1
        elif self._heading_ns is not None and 0 <= now_ns - self._heading_ns < CLOSEST_NS:
            self.counters["headings_too_often"] += 1
        else:
            self.counters["headings"] += 1
            self._use_heading(heading_deg, now_ns)

    def _use_heading(self, heading_deg: float, now_ns: int) -> None:
        self._heading_ns = now_ns
        attitude = from_euler_deg(wrap_degrees_360(heading_deg), 0.0, 0.0)
        self._give_attitude(AttitudeSample(time_ns=now_ns, quaternion_wxyz=attitude))

    async def _report_fixed_place(self) -> None:
        latitude_deg, longitude_deg = self._settings.latitude_deg, self._settings.longitude_deg
        assert latitude_deg is not None
        assert longitude_deg is not None
        while True:
            self._place(latitude_deg, longitude_deg, None)
            await asyncio.sleep(FIXED_PERIOD_S)

    async def _read(
        self,
        address: Address,
        take: Callable[[Sentence], None] | Callable[[GpsdReport], None],
        parser: SentenceParser | GpsdParser,
    ) -> None:
        await keep_open(address, take, parser, opened=self._opened, failed=self._failed)

    async def _request_reports(self) -> None:
        while True:
            last_ns = max(self._place_ns or 0, self._heading_ns or 0)
            if self._link is not None and self._clock_ns() - last_ns > ns_from_s(
                WATCH_PERIOD_S
            ):
                self._link.send(WATCH)
            await asyncio.sleep(WATCH_PERIOD_S if self._link else 0.1)

    def _opened(self, link: Link | None) -> None:
        self._link = link
        if link is not None:
            self._fault = None

    def _failed(self, error: UavrtError) -> None:
        if self._fault is None:
            log.warning(
                "position of this station unavailable; pulses get no position",
                reason=str(error),
            )
        self._fault = str(error)
