"""Tables and verdict of the rotation experiment, as lines of text."""

from collections.abc import Sequence

from uavrt_experiments.rotation.cart import BEARING_DEG, DECLINATION_DEG
from uavrt_experiments.rotation.reading import wrapped
from uavrt_experiments.rotation.run import Case, WallSurvey
from uavrt_experiments.tables import aligned


def case_lines(cases: Sequence[Case]) -> list[str]:
    """One line for each combination of causes."""
    lines = [["", "shift", "PCA", "ours", "arc", "fig. 5.16", "fig. 5.17"]]
    for case in cases:
        reading = case.reading
        ours = reading.bearing
        text = f"{wrapped(ours.bearing_deg - BEARING_DEG):+.0f}°"
        if not ours.accepted:
            text = "none"
        elif ours.ambiguous:
            text += "?"
        pca = wrapped(reading.pca_deg - BEARING_DEG)
        lines.append(
            [
                *(case.name, f"{case.shift_deg:+.0f}°", f"{pca:+.0f}°", text),
                *(f"{reading.covered_deg:.0f}°", _yes(case.like_figure_16)),
                _yes(case.like_figure_17),
            ]
        )
    return aligned(lines, numbers_from=1).splitlines()


def legend_lines() -> list[str]:
    """Legend of the columns."""
    return [
        "shift: strongest pulses from the tag's true bearing; PCA: the original's bearing; "
        "ours: pattern_ml,",
        '"?" where it says itself that it is not to be trusted, "none" where it finds no '
        "direction; arc: headings in the log.",
        "fig. 5.16: yaw keeps to a half circle in a full turn; fig. 5.17: shifted by "
        "50° ± 15°.",
    ]


def sweep_lines(sweep: Sequence[tuple[float, float]]) -> list[str]:
    """Lines on the shift over the heading at the program's start."""
    lines = ["heading from the tag at the original's start → shift of the strongest pulses:"]
    lines.append("  ".join(f"{away:.0f}° → {shift:+.0f}°" for away, shift in sweep))
    return lines


def wall_lines(survey: WallSurvey) -> list[str]:
    """Lines on the effect of reflections alone."""
    return [
        f"{survey.walls} random walls, 8 to 60 m away, reflecting 30 to 90 % of the field:",
        f"  true poses: median shift {survey.median_deg:.1f}°; by 35° to 65° in "
        f"{100 * survey.shifted:.0f} % of them, with yaw in a half circle in "
        f"{100 * survey.shifted_and_folded:.0f} %",
        f"  original's poses, started at the tag: by 35° to 65° in "
        f"{100 * survey.shifted_original:.0f} %",
        f"  where true poses shift by over 15°, our bearing is right within 15° or says that "
        f"it is ambiguous in {100 * survey.flagged:.0f} %",
    ]


def polarization_lines(
    table: Sequence[tuple[float, int, float | None, int, float | None]],
) -> list[str]:
    """Lines on the bearing error under polarization mismatch."""
    lines = [["mismatch", "open field", "wall"]]
    lines += [
        [f"{mismatch:.0f}°", _error(pulses, error), _error(with_wall, error_with_wall)]
        for mismatch, pulses, error, with_wall, error_with_wall in table
    ]
    heading, *rest = aligned(lines, numbers_from=0).splitlines()
    return [f"{heading}  (pulses, bearing error)", *rest]


def verdict_lines(cases: Sequence[Case], survey: WallSurvey) -> list[str]:
    """Lines on the cause of the thesis's figures, decided by the numbers of this run."""
    folded = [case for case in cases if case.like_figure_16]
    both = [case for case in folded if case.like_figure_17]
    started_there = [case for case in cases if case.first_off_deg == 0.0]
    honest = [case for case in cases if not case.original]
    worst = max((abs(case.shift_deg) for case in honest), default=0.0)
    lines = []
    if folded and all(case.original for case in folded) and not survey.shifted_and_folded:
        lines.append(
            "Figure 5.16, a full turn that rises, falls and returns within a half circle, "
            "comes about only with the original's half-way poses. Under them each angle of "
            "figure 5.17 is half of the true one: its 50° stand for 100°."
        )
    else:
        lines.append("Figure 5.16 also comes about without the half-way poses.")
    lines += [f"Both figures at once: {case.name} ({case.shift_deg:+.0f}°)." for case in both]
    lines.append(
        "Started while facing the tag, half-way poses leave the strongest pulses in place ("
        + ", ".join(f"{case.shift_deg:+.0f}°" for case in started_there)
        + ") and move the back lobe from 180° to ±90°. The text has the cart face the tag "
        "before the program's start; then the missing 100° lie in the autopilot's heading at "
        "that moment, or in the wave."
    )
    lines.append(
        f"Reflections with true poses: {worst:.0f}° here, by 35° to 65° in "
        f"{100 * survey.shifted:.0f} % of {survey.walls} walls. They are no explanation "
        "while the direct wave is not blocked, which this world cannot do."
    )
    lines.append(
        f"Magnetic against true north is {DECLINATION_DEG:.0f}° of any comparison with 351°."
    )
    return lines


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _error(pulses: int, error: float | None) -> str:
    return f"{pulses} pulses" if error is None else f"{pulses} pulses, {error:+.1f}°"
