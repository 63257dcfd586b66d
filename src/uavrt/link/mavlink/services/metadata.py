"""Metadata files that a ground station can fetch from the drone side, made in memory.

COMPONENT_METADATA (397) names the general file, which names the other files; ground stations
fetch the files by MAVLink FTP and cache them by checksum. Formats: general.schema.json and
parameter.schema.json, version 1, of MAVLink's component metadata service.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from uavrt.config.parameters import OFFERED, Parameter
from uavrt.link.mavlink.services.ftp_wire import checksum

GENERAL_PATH = "metadata/general.json"
PARAMETERS_PATH = "metadata/parameters.json"
TYPE_PARAMETER = 1
"""Type number of parameter metadata: COMP_METADATA_TYPE_PARAMETER."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Metadata:
    """The metadata files, and the COMPONENT_METADATA message that names the general one."""

    files: Mapping[str, bytes]
    """Contents of the files by path, for `uavrt.link.mavlink.services.ftp_files.FileTree`."""
    uri: str
    crc: int


def component_metadata(
    parameters: Iterable[Parameter] = OFFERED.values(), *, floats: bool = False
) -> Metadata:
    """Make the metadata files of uavrt's parameters; `floats`: declare all as float."""
    described = [_described(row, floats) for row in parameters]
    listing = _json({"version": 1, "parameters": described})
    general = _json(
        {
            "version": 1,
            "metadataTypes": [
                {
                    "type": TYPE_PARAMETER,
                    "uri": f"mftp:///{PARAMETERS_PATH}",
                    "fileCrc": checksum(listing),
                }
            ],
        }
    )
    return Metadata(
        files={GENERAL_PATH: general, PARAMETERS_PATH: listing},
        uri=f"mftp:///{GENERAL_PATH}",
        crc=checksum(general),
    )


def _described(row: Parameter, floats: bool) -> dict[str, Any]:
    low = row.low if row.absent is None else min(row.low, row.absent)
    entry: dict[str, Any] = {
        "name": row.name,
        "type": "Float" if floats or row.kind == "real" else "Int32",
        "group": row.name.partition("_")[0],
        "category": "Standard",
        "shortDesc": row.short,
        "longDesc": row.meaning + (" In force at once." if row.live else ""),
        "min": low,
        "max": row.high,
        "default": row.default,
    }
    if row.volatile:
        entry["volatile"] = True
    if row.unit:
        entry["units"] = row.unit
    if row.kind == "real":
        entry["decimalPlaces"] = row.decimals
    if row.kind == "switch":
        entry["values"] = [
            {"value": 0, "description": "Off"},
            {"value": 1, "description": "On"},
        ]
    if row.kind == "choice":
        entry["values"] = [
            {"value": number, "description": name} for number, name in enumerate(row.choices)
        ]
    return entry


def _json(content: object) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()
