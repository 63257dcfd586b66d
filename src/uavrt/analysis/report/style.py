"""How the report's figures look; matplotlib is loaded here and nowhere else.

Figures are objects: nothing of pyplot's global state, so reports can be made in threads.
"""

import base64
import io
from typing import TYPE_CHECKING, Any

from uavrt.errors import needs_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

# Okabe and Ito, "Color universal design", 2008: told apart by people with any color vision.
TAG_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195")
INK, SOFT, FAINT = "#1b2430", "#5c6773", "#c9d0d8"
SNR_COLORS = "viridis"
A4_IN = (8.27, 11.69)

_SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "text.color": INK,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}


def styled() -> Any:
    """Make a context in which figures are drawn and saved.

    Raises
    ------
    UsageError
        The extra ``uavrt[analysis]`` is not installed.
    """
    with needs_extra("analysis", "a report"):
        import matplotlib as mpl
    settings: Any = _SETTINGS  # the stubs want each key as a literal
    return mpl.rc_context(settings)


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Make an empty figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def svg_data(figure: "Figure") -> str:
    """Encode a figure as a data URI: text of the page, no request."""
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None}, dpi=150)
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()


def outlined() -> Any:
    """Draw a white edge, for what lies on colors."""
    from matplotlib.patheffects import withStroke

    return withStroke(linewidth=2.5, foreground="white")


def tag_color(tag_ids: tuple[int, ...], tag_id: int) -> str:
    """Color of a tag, the same in all figures of a report."""
    return TAG_COLORS[tag_ids.index(tag_id) % len(TAG_COLORS)]


def message(target: "FigureBase", text: str) -> None:
    """Explain, in place of a figure, why there is none."""
    axes: Axes = target.subplots()
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, ha="center", va="center", color=SOFT, wrap=True)
