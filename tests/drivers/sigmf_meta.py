"""SigMF descriptions of samples that tests write themselves."""

import json
from pathlib import Path
from typing import Any


def write_meta(
    path: Path, rate_hz: float, *captures: dict[str, Any], datatype: str = "cf32_le"
) -> Path:
    """Describe the samples of this name; a capture begins with the first unless it says so.

    Fields of captures are named without `core:`.
    """
    about = {"datatype": datatype, "sample_rate": rate_hz, "version": "1.2.0"}
    meta = {
        "global": _core(about),
        "captures": [_core({"sample_start": 0} | one) for one in captures],
        "annotations": [],
    }
    path = path.with_suffix(".sigmf-meta")
    path.write_text(json.dumps(meta), encoding="utf-8")
    return path


def _core(fields: dict[str, Any]) -> dict[str, Any]:
    return {f"core:{name}": value for name, value in fields.items()}
