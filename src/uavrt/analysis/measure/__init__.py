"""Search recordings and measure tags after the flight.

`detect` and `redetect` search recordings, `channelize` splits them into channels, `measure_tag`
measures frequency, interval and width of a tag in your hand, `switched` measures
recordings made with an antenna switch, `waterfall` shows a recording.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.analysis.measure.antenna_files import antenna_named, write_antenna
    from uavrt.analysis.measure.bag import export_bag
    from uavrt.analysis.measure.channel_files import (
        ChannelizeSummary,
        channelize,
        plan_channels,
        ports_of,
    )
    from uavrt.analysis.measure.coded_bursts import MeasuredCode
    from uavrt.analysis.measure.measure_tag import Measurement, measure_tags
    from uavrt.analysis.measure.measured_tag import MeasuredRate, MeasuredTag
    from uavrt.analysis.measure.recorded_pulses import DetectionChain, DetectionSummary, detect
    from uavrt.analysis.measure.redetect import FlightWriter, posed_in
    from uavrt.analysis.measure.shapes import (
        REGION_SHARES,
        Point,
        ray,
        ray_length_m,
        region95,
        region_lines,
        remarks_of,
        rings95,
        split_area_at_date_line,
        split_at_date_line,
        way_of,
        wedge,
    )
    from uavrt.analysis.measure.switched import switched_bearings
    from uavrt.analysis.measure.tag_source import TagSource, read_tag_source
    from uavrt.analysis.measure.waterfall import MaximumHold, Waterfall

__all__ = [
    "REGION_SHARES",
    "ChannelizeSummary",
    "DetectionChain",
    "DetectionSummary",
    "FlightWriter",
    "MaximumHold",
    "MeasuredCode",
    "MeasuredRate",
    "MeasuredTag",
    "Measurement",
    "Point",
    "TagSource",
    "Waterfall",
    "antenna_named",
    "channelize",
    "detect",
    "export_bag",
    "measure_tags",
    "plan_channels",
    "ports_of",
    "posed_in",
    "ray",
    "ray_length_m",
    "read_tag_source",
    "region95",
    "region_lines",
    "remarks_of",
    "rings95",
    "split_area_at_date_line",
    "split_at_date_line",
    "switched_bearings",
    "way_of",
    "wedge",
    "write_antenna",
]
__getattr__ = lazily(
    __name__,
    {
        "ChannelizeSummary": "channel_files",
        "DetectionChain": "recorded_pulses",
        "DetectionSummary": "recorded_pulses",
        "FlightWriter": "redetect",
        "MaximumHold": "waterfall",
        "MeasuredCode": "coded_bursts",
        "MeasuredRate": "measured_tag",
        "MeasuredTag": "measured_tag",
        "Measurement": "measure_tag",
        "Point": "shapes",
        "REGION_SHARES": "shapes",
        "TagSource": "tag_source",
        "Waterfall": "waterfall",
        "antenna_named": "antenna_files",
        "channelize": "channel_files",
        "detect": "recorded_pulses",
        "export_bag": "bag",
        "measure_tags": "measure_tag",
        "plan_channels": "channel_files",
        "ports_of": "channel_files",
        "posed_in": "redetect",
        "ray": "shapes",
        "ray_length_m": "shapes",
        "read_tag_source": "tag_source",
        "region95": "shapes",
        "region_lines": "shapes",
        "rings95": "shapes",
        "split_area_at_date_line": "shapes",
        "split_at_date_line": "shapes",
        "remarks_of": "shapes",
        "switched_bearings": "switched",
        "way_of": "shapes",
        "wedge": "shapes",
        "write_antenna": "antenna_files",
    },
)
