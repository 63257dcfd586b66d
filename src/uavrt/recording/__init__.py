"""The flight directory: written so that nothing is lost, readable even when damaged.

The recorder of samples, `uavrt.recording.iq_recorder`, needs NumPy and is not loaded here.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.recording.channel_recorder import ChannelRecorder
    from uavrt.recording.csv_line import csv_cells
    from uavrt.recording.detector_configs import (
        DetectorConfig,
        detector_config,
        read_detector_config,
        write_detector_config,
    )
    from uavrt.recording.fields import fields_of
    from uavrt.recording.flight_order import (
        FLIGHT_ORDER,
        FLIGHT_PREFIX,
        flights_in_order,
        names_in_order,
        note_flight,
    )
    from uavrt.recording.flight_reader import (
        Flight,
        read_flight,
        read_health,
        read_search_notes,
        read_search_reports,
        read_stops,
        told_in,
    )
    from uavrt.recording.flight_recorder import FlightRecorder
    from uavrt.recording.heard import heard_tags
    from uavrt.recording.integrated import (
        FlightFold,
        IntegratedPart,
        IntegratedVerdict,
        Ring,
        SearchedFor,
        read_folds,
        read_integrated,
        write_integrated,
    )
    from uavrt.recording.iq_recorder import IQRecorder
    from uavrt.recording.layout import FlightLayout, new_flight_directory, require_writable
    from uavrt.recording.outline import (
        FlightOutline,
        HeardTag,
        battery_note,
        read_outline,
        read_pulse_milliseconds,
    )
    from uavrt.recording.places import (
        Mark,
        Places,
        home_note,
        mark_note,
        places_of,
        vehicle_note,
        vehicle_of,
    )
    from uavrt.recording.plain_database import ended, open_plain, watch
    from uavrt.recording.process_log import ProcessLog
    from uavrt.recording.pulse_files import (
        PulseFormat,
        PulseWriter,
        inside_record,
        pulse_format,
        pulse_from_record,
        pulse_record,
        read_pulse_file,
    )
    from uavrt.recording.pulse_pose_log import read_pulse_pose_log
    from uavrt.recording.schema import (
        POSE_COLUMNS,
        TAG_COLUMNS,
        pose_row,
        read_older,
        tag_from_row,
    )
    from uavrt.recording.spool import note_deliveries, undelivered
    from uavrt.recording.writer_lock import WriterLock

__all__ = [
    "FLIGHT_ORDER",
    "FLIGHT_PREFIX",
    "POSE_COLUMNS",
    "TAG_COLUMNS",
    "ChannelRecorder",
    "DetectorConfig",
    "Flight",
    "FlightFold",
    "FlightLayout",
    "FlightOutline",
    "FlightRecorder",
    "HeardTag",
    "IQRecorder",
    "IntegratedPart",
    "IntegratedVerdict",
    "Mark",
    "Places",
    "ProcessLog",
    "PulseFormat",
    "PulseWriter",
    "Ring",
    "SearchedFor",
    "WriterLock",
    "battery_note",
    "csv_cells",
    "detector_config",
    "ended",
    "fields_of",
    "flights_in_order",
    "heard_tags",
    "home_note",
    "inside_record",
    "mark_note",
    "names_in_order",
    "new_flight_directory",
    "note_deliveries",
    "note_flight",
    "open_plain",
    "places_of",
    "pose_row",
    "pulse_format",
    "pulse_from_record",
    "pulse_record",
    "read_detector_config",
    "read_flight",
    "read_folds",
    "read_health",
    "read_integrated",
    "read_older",
    "read_outline",
    "read_pulse_file",
    "read_pulse_milliseconds",
    "read_pulse_pose_log",
    "read_search_notes",
    "read_search_reports",
    "read_stops",
    "require_writable",
    "tag_from_row",
    "told_in",
    "undelivered",
    "vehicle_note",
    "vehicle_of",
    "watch",
    "write_detector_config",
    "write_integrated",
]
__getattr__ = lazily(
    __name__,
    {
        "FlightOutline": "outline",
        "HeardTag": "outline",
        "battery_note": "outline",
        "read_outline": "outline",
        "read_pulse_milliseconds": "outline",
        "ChannelRecorder": "channel_recorder",
        "DetectorConfig": "detector_configs",
        "Flight": "flight_reader",
        "FlightLayout": "layout",
        "FlightRecorder": "flight_recorder",
        "IQRecorder": "iq_recorder",
        "FlightFold": "integrated",
        "IntegratedPart": "integrated",
        "IntegratedVerdict": "integrated",
        "Ring": "integrated",
        "SearchedFor": "integrated",
        "Mark": "places",
        "POSE_COLUMNS": "schema",
        "Places": "places",
        "ProcessLog": "process_log",
        "PulseFormat": "pulse_files",
        "PulseWriter": "pulse_files",
        "TAG_COLUMNS": "schema",
        "WriterLock": "writer_lock",
        "csv_cells": "csv_line",
        "detector_config": "detector_configs",
        "ended": "plain_database",
        "fields_of": "fields",
        "flights_in_order": "flight_order",
        "heard_tags": "heard",
        "home_note": "places",
        "mark_note": "places",
        "new_flight_directory": "layout",
        "names_in_order": "flight_order",
        "FLIGHT_ORDER": "flight_order",
        "FLIGHT_PREFIX": "flight_order",
        "note_flight": "flight_order",
        "note_deliveries": "spool",
        "open_plain": "plain_database",
        "places_of": "places",
        "vehicle_note": "places",
        "vehicle_of": "places",
        "pose_row": "schema",
        "pulse_format": "pulse_files",
        "pulse_from_record": "pulse_files",
        "inside_record": "pulse_files",
        "pulse_record": "pulse_files",
        "read_detector_config": "detector_configs",
        "read_flight": "flight_reader",
        "read_health": "flight_reader",
        "read_folds": "integrated",
        "read_integrated": "integrated",
        "read_older": "schema",
        "read_pulse_file": "pulse_files",
        "read_pulse_pose_log": "pulse_pose_log",
        "read_search_notes": "flight_reader",
        "read_search_reports": "flight_reader",
        "read_stops": "flight_reader",
        "told_in": "flight_reader",
        "require_writable": "layout",
        "tag_from_row": "schema",
        "undelivered": "spool",
        "watch": "plain_database",
        "write_detector_config": "detector_configs",
        "write_integrated": "integrated",
    },
)
