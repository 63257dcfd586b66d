"""Make reports of flights by running ``uavrt report``.

Its plotting library takes 65 MB, which a ground station should not keep in memory.
"""

import asyncio
import sys
from hashlib import sha256
from pathlib import Path

from uavrt.core.errors import RecordingError
from uavrt.ground.store.estimates import AntennaChoice

TIMEOUT_S = 180.0

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; sandbox; "
    "frame-ancestors 'none'"
)
"""Content security policy of a report: no scripts, since people typed the names in it."""
_BY_COMMAND = "Make the report with the command uavrt report"
FACTS = "report.toml"
"""File of texts about flights, written by people (`uavrt.analysis.inputs.flight_facts`)."""


class Reporter:
    """Makes reports, one at a time; keeps each until its flight changes."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._busy = asyncio.Lock()

    async def report(self, flight: Path, antenna: AntennaChoice) -> bytes:
        """Report of a flight as HTML; raises `RecordingError`."""
        place = self._directory / flight.name / _named(antenna)
        async with self._busy:
            return await asyncio.to_thread(_kept, place, flight) or await _made(
                place, flight, antenna
            )


def _named(antenna: AntennaChoice) -> str:
    """Name of the folder for reports with one antenna and its settings."""
    usual = AntennaChoice(pattern=antenna.pattern, offset_deg=antenna.offset_deg)
    name = antenna.pattern + (f"{antenna.offset_deg:+g}" if antenna.offset_deg else "")
    return (
        name if antenna == usual else f"{name} {sha256(repr(antenna).encode()).hexdigest()[:8]}"
    )


def _kept(place: Path, flight: Path) -> bytes | None:
    """Return the stored report if the flight has not changed since; otherwise None."""
    report = place / "report.html"
    if not report.is_file():
        return None
    facts = [path for path in (flight / FACTS, flight.parent / FACTS) if path.is_file()]
    changed = max(path.stat().st_mtime for path in (*flight.glob("flight.sqlite*"), *facts))
    return report.read_bytes() if report.stat().st_mtime > changed else None


async def run_uavrt(*arguments: str) -> tuple[int | None, str]:
    """Run ``uavrt`` as a program; return its exit code and the end of its error output."""
    program = await asyncio.create_subprocess_exec(
        *(sys.executable, "-P", "-m", "uavrt.cli", *arguments),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        _, errors = await program.communicate()
    except asyncio.CancelledError:
        program.kill()
        raise
    return program.returncode, errors.decode("utf-8", "replace").strip()[-400:]


async def _made(place: Path, flight: Path, antenna: AntennaChoice) -> bytes:
    await asyncio.to_thread(place.mkdir, parents=True, exist_ok=True)
    try:
        async with asyncio.timeout(TIMEOUT_S):
            code, text = await run_uavrt(
                *("report", str(flight)),
                *("--antenna", antenna.pattern, f"--antenna-offset={antenna.offset_deg}"),
                *("--heading-error", str(antenna.heading_sigma_deg)),
                *("--height-error", str(antenna.height_sigma_m)),
                *("--no-pdf", "-o", str(place)),
                *(("--dem", antenna.dem) if antenna.dem else ()),
            )
    except TimeoutError as error:
        late = f"the report was not ready after {TIMEOUT_S:g} s"
        raise RecordingError(late, remedy=_BY_COMMAND) from error
    if code != 0:
        if not text:
            raise RecordingError("the report could not be made", remedy=_BY_COMMAND)
        raise RecordingError(f"the report could not be made: {text}")
    return await asyncio.to_thread((place / "report.html").read_bytes)
