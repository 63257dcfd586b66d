"""Draw flights folded at a tag's pulse interval, so that a detection can be checked by eye.

Phase is shown to the right and time downwards, as for pulsars: a tag appears as a vertical line
in the noise. The profile above is the sum of all rows, in which each pulse is weighted as in
the search.
"""

from typing import TYPE_CHECKING

import numpy as np

from uavrt.analysis.report.style import FAINT, SNR_COLORS, SOFT

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

    from uavrt.flight.integrated import FlightFold

CAPTION = (
    "The whole flight, folded at the pulse interval that was found. Each row is a part of the "
    "flight and spans one interval, with the expected pulse in the middle. A tag shows as a "
    "vertical line, interrupted where the antenna pointed away, and as a peak in the profile "
    "above. If there is neither, doubt the result."
)
_LOWEST, _HIGHEST = -2.0, 6.0


def draw_fold(target: "FigureBase", fold: "FlightFold", color: str) -> None:
    """Draw the summed profile of a flight, and the signal folded at the interval."""
    above, below = target.subplots(2, 1, sharex=True, height_ratios=(1, 2.6))
    half_ms = 500.0 * fold.interval_s
    profile = np.array(fold.profile)
    step_ms = 2.0 * half_ms / len(profile)
    phase_ms = (np.arange(len(profile)) + 0.5) * step_ms - half_ms
    above.axhline(0.0, color=FAINT, lw=0.8)
    above.plot(phase_ms, profile, color=color, lw=0.9)
    above.set_ylabel("sum [σ]")
    above.grid(visible=True)
    image = below.imshow(
        np.array(fold.raster),
        extent=(-half_ms, half_ms, fold.length_s / 60.0, 0.0),
        aspect="auto",
        interpolation="nearest",
        cmap=SNR_COLORS,
        vmin=_LOWEST,
        vmax=_HIGHEST,
    )
    below.set_xlabel(f"phase within the interval of {fold.interval_s:.5f} s [ms]")
    below.set_ylabel("time [min]")
    bar = target.colorbar(image, ax=below, pad=0.015, extend="both")
    bar.set_label("standard deviations of noise (σ)", color=SOFT)
