"""Read, check and write ``uavrt.toml``.

pydantic is imported only inside these functions, since it costs 29 MB and 95 ms. The drone's
processes receive checked settings and do not import it.
"""

import json
import os
import textwrap
import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavrt.config.guidance_rules import guidance_faults
from uavrt.config.radios import RADIOS, RadioRow
from uavrt.config.settings import RADIO_GROUP, Settings
from uavrt.config.text_files import decode_text
from uavrt.config.toml_lines import find_lines, line_of
from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import ConfigError, listed_faults, os_errors_as
from uavrt.core.foreign import MOST_FAULTS, SETTINGS, check_toml, read_file, shortened
from uavrt.core.plugins import Registry

if TYPE_CHECKING:
    from pydantic import TypeAdapter
    from pydantic_core import ErrorDetails

_WIDTH = 92


def load_settings(path: str | os.PathLike[str]) -> Settings:
    """Read ``uavrt.toml``; raises `ConfigError` that lists all faults with their lines."""
    name = os.fspath(path)
    with os_errors_as(
        ConfigError,
        f"cannot read the settings {name}",
        "Check the name; without --config the defaults apply",
    ):
        content = read_file(path, SETTINGS)
    return parse_settings(content, name=name)


def parse_settings(content: bytes, *, name: str) -> Settings:
    """Read settings; `name` is for messages. Raises `ConfigError` that lists all faults."""
    from pydantic import ValidationError

    try:
        text = decode_text(content)
        check_toml(text, SETTINGS)
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise _error(name, [f"not TOML: {error}"]) from None
    except ValueError as error:
        raise _error(name, [str(error)]) from None
    lines = find_lines(text)
    faults = [
        (line_of(lines, (table, key)) or 1, text)
        for table, found in (
            ("radio", _radio_faults(document)),
            ("guidance", guidance_faults(document)),
        )
        for key, text in found
    ]
    try:
        # Through JSON, where a list may be a tuple and strict types are still checked: "3" is
        # no number and 3.5 no count. Dates, which no setting has, become text and are refused.
        settings = _settings_adapter().validate_json(json.dumps(document, default=str))
    except ValidationError as error:
        schema = settings_schema()
        faults += [
            (line_of(lines, tuple(detail["loc"])) or 1, _explain(detail, schema))
            for detail in error.errors(include_url=False)[: 2 * MOST_FAULTS]
        ]
    if faults:
        listed = [f"line {line}: {text}" for line, text in sorted(faults)]
        raise _error(name, shortened(listed))
    return settings


def _radio_faults(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the key and an error text for an unknown kind of radio and for each value that the
    chosen radio does not support.
    """
    table = document.get("radio")
    if not isinstance(table, dict):
        return
    kind = table.get("kind", "airspy")
    kinds = Registry[object](RADIO_GROUP, dict.fromkeys(RADIOS))
    if not isinstance(kind, str):
        return
    if kind not in kinds:
        given = json.dumps(kind, ensure_ascii=False)[:60]
        *most, last = (repr(one) for one in kinds)
        yield "kind", f"[radio] kind is {given}, but must be {', '.join(most)} or {last}"
    elif kind in RADIOS:
        yield from _faults_of_radio(RADIOS[kind], table)


def _faults_of_radio(radio: RadioRow, table: dict[str, Any]) -> Iterator[tuple[str, str]]:
    gain, rate_hz = table.get("gain"), table.get("sample_rate_hz")
    low, high = radio.gains
    if type(gain) is int and not low <= gain <= high:
        yield "gain", f"[radio] gain is {gain}, but must be {low} to {high} ({radio.kind})"
    # A program in place of the radio's own may offer any rate.
    if not isinstance(rate_hz, int | float) or table.get("program"):
        return
    if not radio.takes_rate(rate_hz):
        text = f"{rate_hz:.10g}, but must be {radio.rates_text()} ({radio.kind})"
        yield "sample_rate_hz", f"[radio] sample_rate_hz is {text}"


def settings_schema() -> dict[str, Any]:
    """JSON Schema of ``uavrt.toml``, for editors that check while typing."""
    return _settings_adapter().json_schema()


@cache
def _settings_adapter() -> "TypeAdapter[Settings]":
    """Return pydantic's reader of settings, cached because it reads docstrings from source."""
    from pydantic import TypeAdapter

    return TypeAdapter(Settings)


def default_settings_text() -> str:
    """Text of a ``uavrt.toml`` with every setting, its default and its description."""
    schema = settings_schema()
    top: list[str] = ["# Settings of uavrt on the drone. Omitted settings have their defaults."]
    tables: list[str] = []
    for name, entry in schema["properties"].items():
        table = _table_schema(schema, name)
        if table is None:
            top += ["", *_setting_lines(name, entry)]
            continue
        description = _plain(str(table["description"]).split(": ", 1)[-1])
        tables += ["", f"[{name}]  # {description.rstrip('.')}"]
        for key, inner in table["properties"].items():
            tables += _setting_lines(key, inner)
    return "\n".join([*top, *tables]) + "\n"


def write_default_settings(path: str | os.PathLike[str]) -> None:
    """Write a commented ``uavrt.toml`` with defaults; raises `ConfigError` if it exists."""
    target = Path(path)
    if target.exists():
        raise ConfigError(
            f"{target} exists already", remedy="Choose another name or move it away"
        )
    with os_errors_as(
        ConfigError,
        f"cannot write {target}",
        "Choose a directory that exists and can be written",
    ):
        write_atomically(target, default_settings_text())


def _error(name: str, faults: list[str]) -> ConfigError:
    return ConfigError(listed_faults(name, faults), remedy="Correct these lines and try again")


def _table_schema(schema: dict[str, Any], name: str) -> dict[str, Any] | None:
    reference = schema["properties"].get(name, {}).get("$ref")
    return None if reference is None else schema["$defs"][reference.rsplit("/", 1)[-1]]


def _explain(detail: "ErrorDetails", schema: dict[str, Any]) -> str:
    """Convert an error of pydantic to a sentence such as ``[radio] gian is unknown; …``."""
    where = [str(part) for part in detail["loc"]]
    table = _table_schema(schema, where[0]) if where else None
    label = f"[{where[0]}] {'.'.join(where[1:])}".rstrip() if table else ".".join(where)
    context = detail.get("ctx", {})
    given = json.dumps(detail["input"], default=str, ensure_ascii=False)[:60]
    if detail["type"] == "unexpected_keyword_argument":
        known = list((table or schema)["properties"])
        near = get_close_matches(where[-1], known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
        return f"{label} is unknown; {hint}"
    words = {
        "literal_error": f"must be {context.get('expected')}",
        "finite_number": "must be a finite number",
        "int_type": "must be a whole number",
        "int_from_float": "must be a whole number",
        "float_type": "must be a number without quotes",
        "bool_type": "must be true or false",
        "string_type": "must be text in quotes",
        "tuple_type": 'must be a list of texts, like ["a", "b"]',
        "dataclass_type": f"must be a table with the heading [{where[0] if where else ''}]",
        "greater_than": f"must be above {context.get('gt')}",
        "greater_than_equal": f"must be at least {context.get('ge')}",
        "less_than": f"must be below {context.get('lt')}",
        "less_than_equal": f"must be at most {context.get('le')}",
    }
    reason = words.get(detail["type"]) or _rule(detail["type"], detail["msg"])
    return f"{label} is {given}, but {reason}"


def _setting_lines(key: str, entry: dict[str, Any]) -> list[str]:
    """Format one setting as lines of ``uavrt.toml``: its description as a comment, then the
    default; without a default, the key is commented out.
    """
    comment = [f"# {line}" for line in _plain(str(entry.get("description", ""))).split("\n")]
    default = entry.get("default")
    if default is None:
        return [*comment, f"# {key} ="]
    if isinstance(default, float) and default.is_integer() and abs(default) < 1e15:
        shown = f"{default:.1f}"
    else:
        shown = json.dumps(default)
    return [*comment, f"{key} = {shown}"]


def _plain(text: str) -> str:
    joined = " ".join(text.replace("``", "").split())
    return textwrap.fill(joined, _WIDTH, break_long_words=False, break_on_hyphens=False)


def _rule(kind: str, text: str) -> str:
    """Explain in words which custom rule a setting violates, since pydantic reports only the
    rule's function name.
    """
    if kind == "predicate_failed" and "is_ros_namespace" in text:
        return "a ROS namespace has letters, digits and single underscores, like drone1"
    return text.lower()
