"""Pictures of the runs' paths."""

from pathlib import Path

from uavrt_experiments.search.flight import Outcome
from uavrt_experiments.search.scenario import Scenario
from uavrt_experiments.search.table import Flown


def draw(scenario: Scenario, flown: list[Flown], path: Path) -> None:
    """Draw the first run of each planner into one picture.

    `path`: path of the PNG or SVG file.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.patches import Circle

    columns = min(4, len(flown))
    rows = -(-len(flown) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(3.4 * columns, 3.6 * rows), squeeze=False
    )
    for axis in axes.ravel()[len(flown) :]:
        axis.set_axis_off()
    for axis, one in zip(axes.ravel(), flown, strict=False):
        run: Outcome = one.outcomes[0]
        axis.plot(*zip(*run.path_m, strict=True), lw=0.8, color="tab:blue")
        axis.plot(*zip(*run.ends_m, strict=True), "k+", ms=7)
        if scenario.keep_away is not None:
            for place in run.ends_m:
                axis.add_patch(
                    Circle(place, scenario.keep_away.radius_m, fill=False, ec="tab:red", lw=0.6)
                )
        axis.set(
            aspect="equal",
            xlim=(-0.1 * scenario.east_m, 1.1 * scenario.east_m),
            ylim=(-0.1 * scenario.north_m, 1.1 * scenario.north_m),
        )
        ended = f"{run.time_s:.0f} s" if run.complete else f"{run.lost} not found"
        axis.set_title(f"{one.contender}\n{ended}", fontsize=7)
        axis.tick_params(labelsize=6)
    figure.suptitle(f"{scenario.name}: {scenario.title} (m; first run of each)", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
