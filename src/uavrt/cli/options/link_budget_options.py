"""Link budget options, for commands that predict a tag's range."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.options.kinds import Decibels, Metres, NoiseFigure

if TYPE_CHECKING:
    from uavrt.planning.detectability.link_budget import LinkBudget


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """The path between a tag and the receiver.

    Parameters
    ----------
    tag_height
        Height of the tag above the ground [m].
    antenna_gain
        Gain on boresight, or towards the tag [dBi]; 4 is usual for two elements, 2 for a
        monopole.
    mismatch
        Loss by polarization, cables and pointing [dB].
    noise_figure
        Noise that receiver, drone and sky add to the thermal noise [dB]. For a past flight, the
        rise of its noise above the quietest level is added.
    free_space
        Ignore the ray reflected by the ground.
    """

    tag_height: Metres = 0.5
    antenna_gain: Decibels = 4.0
    mismatch: Decibels = 3.0
    noise_figure: NoiseFigure = 8.0
    free_space: Annotated[bool, Parameter(negative="")] = False

    def link(
        self,
        *,
        power_dbm: float,
        height_m: float,
        frequency_hz: float,
        pulse_width_s: float,
        drone_noise_db: float = 0.0,
    ) -> "LinkBudget":
        """Link budget between a tag of a radiated power and a drone at a height [m]."""
        from uavrt.planning.detectability.link_budget import LinkBudget

        return LinkBudget(
            frequency_hz=frequency_hz,
            pulse_width_s=pulse_width_s,
            tag_eirp_dbm=power_dbm,
            tag_height_m=self.tag_height,
            drone_height_m=height_m,
            antenna_gain_dbi=self.antenna_gain,
            mismatch_db=self.mismatch,
            noise_figure_db=self.noise_figure,
            ground="free" if self.free_space else "two-ray",
            drone_noise_db=drone_noise_db,
        )


USUAL_BUDGET = Budget()
