"""Options of the commands that estimate positions: antenna, heights, errors, ground."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.options.elevation_option import elevation_of
from uavrt.cli.options.kinds import Degrees, DegreesOfError, Metres, MetresOfError

if TYPE_CHECKING:
    from uavrt.localization.estimates.flight_estimates import EstimationOptions


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Placing:
    """How bearings and positions are estimated.

    Parameters
    ----------
    antenna
        Name of the antenna's pattern: {antennas}, or a CSV file of angles and gains; monopole:
        no bearings, positions from signal strength along the flight. By default what the drone
        was set up with (bearings.antenna), RA-23K for a log that does not state it, and
        monopole for UCSD's pings.
    antenna_offset
        Boresight clockwise from the heading that the pulses contain [°]; 0 if the drone's own
        settings already include the mounting.
    height
        With a monopole: height above the tags [m], for logs that do not contain it (UCSD's
        pings).
    heading_error
        Standard deviation of the heading error common to a whole flight [°]: compass, mounting,
        declination. 0 trusts the headings.
    height_error
        With a monopole: standard deviation of the error common to all heights above a tag [m]:
        terrain, a tag on a tree, a take-off on a hill. 0 trusts the heights.
    dem
        Elevation file (SRTM .hgt or GeoTIFF) or a folder of them: hills weaken signals,
        and explain silence. Without it the ground is taken as level.
    sea
        Treat ground that no elevation file covers as water at height 0.
    """

    antenna: str | None = None
    antenna_offset: Degrees = 0.0
    height: Metres | None = None
    heading_error: DegreesOfError = 1.5
    height_error: MetresOfError = 7.0
    dem: Path | None = None
    sea: Annotated[bool, Parameter(negative="")] = False

    def estimation_options(self, method: str = "bayes") -> "EstimationOptions":
        """Convert the options to the estimator's settings; opens the elevation files."""
        from uavrt.analysis.measure.antenna_files import antenna_named
        from uavrt.localization.estimates.flight_estimates import EstimationOptions

        return EstimationOptions(
            method=method,
            antenna=None if self.antenna is None else antenna_named(self.antenna),
            offset_deg=self.antenna_offset,
            height_m=self.height,
            heading_sigma_deg=self.heading_error,
            height_sigma_m=self.height_error,
            elevation=elevation_of(self.dem, sea=self.sea),
        )


USUAL_PLACING = Placing()
