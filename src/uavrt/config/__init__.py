"""What the user writes: ``uavrt.toml`` and tag files, read with all their faults at once."""

from uavrt.config.loader import (
    default_settings_text,
    load_settings,
    parse_settings,
    settings_schema,
    write_default_settings,
)
from uavrt.config.settings import (
    AntennaSettings,
    DetectionSettings,
    MavlinkSettings,
    RadioSettings,
    RecordingSettings,
    Settings,
    UdpChannelSettings,
)
from uavrt.config.tag_files import parse_tags, read_tags, write_tags

__all__ = [
    "AntennaSettings",
    "DetectionSettings",
    "MavlinkSettings",
    "RadioSettings",
    "RecordingSettings",
    "Settings",
    "UdpChannelSettings",
    "default_settings_text",
    "load_settings",
    "parse_settings",
    "parse_tags",
    "read_tags",
    "settings_schema",
    "write_default_settings",
    "write_tags",
]
