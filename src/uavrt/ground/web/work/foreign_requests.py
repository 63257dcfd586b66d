"""Requests that contain untrusted files, parsed in the process of `foreign_worker`."""

from typing import Any

from uavrt.core.errors import FormatError
from uavrt.core.foreign import REQUEST, UPLOADED_FILE, Limit, read_json
from uavrt.ground.link.motions.area_files import area_of_file
from uavrt.ground.store import tag_table


def read_body(content: bytes, limit: Limit = REQUEST) -> Any:
    """Decode the body of a request; raises `FormatError`."""
    try:
        return read_json(content or b"{}", limit)
    except ValueError as error:
        raise FormatError(f"the request is not valid JSON: {error}") from error


def read_object(content: bytes, limit: Limit = REQUEST) -> dict[str, Any]:
    """Decode a request's body; raises `FormatError` if it is not a JSON object."""
    found = read_body(content, limit)
    if not isinstance(found, dict):
        raise FormatError("the request must be a JSON object")
    return found


def checked_tags(content: bytes) -> dict[str, Any]:
    """Check a table while it is typed; return its faults, or without any its warnings."""
    tags, faults = tag_table.tags_from_rows(read_body(content))
    return {"faults": faults, "warnings": tag_table.warnings_of(tags)}


def imported_tags(content: bytes) -> dict[str, Any]:
    """Read table rows from tag files, given as texts by file name."""
    files = read_object(content, UPLOADED_FILE)
    if not all(isinstance(one, str) for one in files.values()):
        raise FormatError("files must be a JSON object with the text of each file by its name")
    rows = tag_table.import_rows(files)
    tags, _ = tag_table.tags_from_rows(rows)
    return {
        "rows": rows,
        "left_out": tag_table.not_selected(files),
        "warnings": tag_table.warnings_of(tags),
        "notes": tag_table.slides_not_sent(files),
    }


def area_in_body(content: bytes) -> dict[str, Any]:
    """Read the area in a file, or a circle; raises `FormatError`."""
    return area_of_file(read_object(content, UPLOADED_FILE))
