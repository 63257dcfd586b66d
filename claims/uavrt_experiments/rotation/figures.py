"""Figures 5.16 and 5.17 of the thesis repeated: yaw over time and SNR over yaw, a row for each
log.
"""

from collections.abc import Sequence
from html import escape

import numpy as np

from uavrt.analysis.report.style import FAINT, INK, TAG_COLORS, new_figure, styled, svg_data
from uavrt.core.units import wrap_degrees_180
from uavrt_experiments.rotation.reading import Reading

Row = tuple[str, Reading, float | None]
"""Name, the log as read, and the true bearing of the tag [deg]."""


def rotation_page(title: str, rows: Sequence[Row], texts: Sequence[Sequence[str]]) -> str:
    """Write one HTML file with the figures and the text below them; needs matplotlib.

    Raises `UsageError`: the extra ``uavrt[analysis]`` is not installed.
    """
    with styled():
        pictures = [_picture(*row) for row in rows]
    shown = "".join(
        f'<figure><figcaption>{escape(name)}</figcaption><img src="{uri}" '
        f'alt="{escape(name)}: yaw over time, SNR over yaw"></figure>'
        for (name, _, _), uri in zip(rows, pictures, strict=True)
    )
    paragraphs = "".join(f"<pre>{escape(chr(10).join(lines))}</pre>" for lines in texts)
    style = (
        "body{font:16px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto}"
        "img{width:100%}pre{font-size:.8rem;white-space:pre-wrap}figure{margin:1rem 0}"
        "figcaption{font-weight:600}"
    )
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}'
        f"</title><style>{style}</style></head><body><h1>{escape(title)}</h1>{paragraphs}{shown}"
        "</body></html>\n"
    )


def _picture(name: str, reading: Reading, bearing_deg: float | None) -> str:
    figure = new_figure(8.0, 2.5)
    left, right = figure.subplots(1, 2)
    # About the tag's bearing, so that no line is cut at north.
    middle = reading.bearing.bearing_deg if bearing_deg is None else bearing_deg
    yaw = wrap_degrees_180(reading.yaw_deg - middle)
    left.plot(reading.time_s, yaw, "o", ms=3, mew=0, color=INK)
    left.axhline(0.0, color=TAG_COLORS[1], lw=1.2)
    left.set_ylim(-180, 180)
    left.set_yticks([-180, -90, 0, 90, 180])
    left.set_xlabel("time [s]")
    left.set_ylabel("logged yaw from the tag [°]")
    right.axvline(0.0, color=TAG_COLORS[1], lw=1.2)
    peak = wrap_degrees_180(reading.peak_deg - middle)
    right.axvline(peak, color=TAG_COLORS[0], lw=1.2, ls="--")
    order = np.argsort(yaw)
    right.plot(yaw[order], reading.snr_db[order], "o", ms=3, mew=0, color=INK)
    right.set_xlim(-180, 180)
    right.set_xticks([-180, -90, 0, 90, 180])
    right.set_xlabel("logged yaw from the tag [°]; dashed: strongest")
    right.set_ylabel("SNR [dB]")
    for axes in (left, right):
        axes.grid(visible=True, color=FAINT)
    return svg_data(figure)
