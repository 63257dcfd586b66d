"""Style of the report's figures. This is the only module that loads matplotlib, without
pyplot's global state, so that threads can create reports.
"""

import base64
import io
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from uavrt.core.errors import needs_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

# Okabe and Ito, "Color universal design", 2008: distinct for people with any color vision.
TAG_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195")
INK, SOFT, FAINT = "#1b2430", "#5c6773", "#c9d0d8"
SNR_COLORS = "viridis"
A4_IN = (8.27, 11.69)
WIDTH_IN = 7.6
"""Width of the report's figures [in]."""

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

_POINTS_PER_IN = 72.0


def styled() -> Any:
    """Context manager with the figures' style. Raises `UsageError` without matplotlib."""
    with needs_extra("analysis", "a report"):
        import matplotlib as mpl
    settings: Any = _SETTINGS  # the stubs want each key as a literal
    return mpl.rc_context(settings)


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Make an empty matplotlib figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def svg_data(figure: "Figure") -> str:
    """Encode a figure as a data URI, which a browser shows without a further request."""
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None}, dpi=150)
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()


def wrapped(text: str, width_in: float, *, size: float = 9, bold: bool = False) -> list[str]:
    """Wrap a text into lines of a width in inches, between words if possible."""
    lines: list[str] = []
    for word in text.split():
        joined = f"{lines[-1]} {word}" if lines else word
        if lines and _width_in(joined, size, bold) <= width_in:
            lines[-1] = joined
            continue
        while len(word) > 1 and _width_in(word, size, bold) > width_in:
            fits = next(
                count
                for count in range(len(word) - 1, 0, -1)
                if count == 1 or _width_in(word[:count], size, bold) <= width_in
            )
            lines.append(word[:fits])
            word = word[fits:]
        lines.append(word)
    return lines or [""]


@lru_cache(maxsize=20_000)
def _width_in(text: str, size: float, bold: bool) -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size, weight="bold" if bold else "normal")
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, ismath=False)
    return float(width) / _POINTS_PER_IN


def outlined() -> Any:
    """Path effect that outlines text and lines in white, to show on colors."""
    from matplotlib.patheffects import withStroke

    return withStroke(linewidth=2.5, foreground="white")


def tag_color(tag_ids: tuple[int, ...], tag_id: int) -> str:
    """Color of a tag, the same in all figures of a report."""
    return TAG_COLORS[tag_ids.index(tag_id) % len(TAG_COLORS)]


def message(target: "FigureBase", text: str) -> None:
    """Write a text into an empty figure, such as the reason why nothing is plotted."""
    axes: Axes = target.subplots()
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, ha="center", va="center", color=SOFT, wrap=True)
