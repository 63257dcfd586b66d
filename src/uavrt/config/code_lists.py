"""Lists of coded tags as people have them: CSV with a heading, or a YAML list.

The heading tells what a column is; names that others give them are taken, too: ``tagFreq``,
``g1`` to ``g7`` and ``bi``. Gaps are in milliseconds, burst intervals in seconds, frequencies
in megahertz. Of YAML there is as much as such a list needs: ``- key: value`` and brackets.
"""

import csv
import re

from uavrt.config.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.tags_toml import read_code

_NAMES: dict[str, Quantity | str] = {
    "id": "id",
    "tag_id": "id",
    "mfgid": "id",
    "name": "name",
    "frequency_mhz": "frequency",
    "tagfreq": "frequency",
    "nomfreq": "frequency",
    "freq": "frequency",
    "burst_interval_s": "burst_interval",
    "bi": "burst_interval",
    "period": "burst_interval",
    "gaps_ms": "gaps",
    "pulse_width_ms": "pulse_width",
    "interval_uncertainty_ms": "interval_uncertainty",
    "k": "k",
}
_GAP = re.compile(r"(?:g|gap|gap_?ms_?)([1-9])(?:_ms)?", re.I)
_HEADING = re.compile(r"""(?:^|[,;\t"' ])(?:g1|gap1|gaps_ms)(?:_ms)?(?:$|[,;\t"' ])""", re.I)
_PAIR = re.compile(r"""^\s*(-?)\s*["']?([\w ]+?)["']?\s*:\s*(.*?)\s*$""")


def is_code_csv(text: str) -> bool:
    """Whether a text's first line with content is the heading of a list of codes."""
    for line in text.split("\n"):
        content = line.strip().lstrip("#").strip()
        if content:
            return _HEADING.search(content) is not None
    return False


def parse_code_csv(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read a CSV list of codes; add what is not understood to `faults`."""
    names: list[str] = []
    drafts = []
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip()
        if not names:
            content = content.lstrip("#").strip()
        if not content or content.startswith("#"):
            continue
        separator = next((one for one in ",;\t" if one in content), ",")
        cells = [cell.strip() for cell in next(csv.reader([content], delimiter=separator))]
        if not names:
            names = cells
            continue
        if len(cells) != len(names):
            text = f"{len(cells)} values where the heading has {len(names)}"
            faults.append(Fault(line=number, text=text))
            continue
        table = {name: (cell, number) for name, cell in zip(names, cells, strict=True) if cell}
        drafts.append(_draft(table, number, faults))
    return drafts


def parse_code_yaml(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read a YAML list of codes; add what is not understood to `faults`."""
    tables: list[tuple[int, dict[str, tuple[str, int]]]] = []
    for number, written in enumerate(text.split("\n"), start=1):
        line = re.sub(r"(^|\s)#.*$", "", written).rstrip()
        if line.strip() in ("", "---", "tags:", "codes:", "..."):
            continue
        if line.strip() == "-":
            tables.append((number, {}))
            continue
        pair = _PAIR.match(line)
        if pair is None or (not tables and not pair.group(1)):
            faults.append(Fault(line=number, text="not a list of tags: write - id: 12"))
            continue
        if pair.group(1):
            tables.append((number, {}))
        key, value = pair.group(2), pair.group(3).strip("\"'")
        if key in tables[-1][1]:
            faults.append(Fault(line=number, text=f"{key} is given twice"))
        tables[-1][1][key] = (value, number)
    return [_draft(table, number, faults) for number, table in tables]


def _draft(table: dict[str, tuple[str, int]], line: int, faults: list[Fault]) -> TagDraft:
    draft = TagDraft(line=line, gaps=())
    before = len(faults)
    gaps: dict[int, float] = {}
    gaps_line = interval_line = line
    interval_s: float | None = None
    for key, (value, at) in table.items():
        if (gap := _GAP.fullmatch(key)) is not None:
            number = _number(key, value, at, faults)
            gaps_line = at
            if number is not None:
                gaps[int(gap.group(1))] = number
            continue
        quantity = _NAMES.get(key.lower())
        if quantity == "gaps":
            gaps_line = at
            for place, part in enumerate(re.split(r"[\s,;]+", value.strip("[] ")), start=1):
                number = _number(key, part, at, faults)
                if number is not None:
                    gaps[place] = number
        elif quantity == "name":
            draft.name = value
        elif quantity is not None:
            number = _number(key, value, at, faults)
            if number is None:
                continue
            if quantity == "burst_interval":
                interval_s, interval_line = number, at
            else:
                unit = "MHz" if quantity == "frequency" else ""
                label = f"{key} {value[:40]}"
                known: Quantity = quantity  # type: ignore[assignment]
                draft.entries[known] = Entry(number=number, label=label, line=at, unit=unit)
    lacking = [place for place in range(1, max(gaps, default=0)) if place not in gaps]
    if lacking and len(faults) == before:
        text = f"this tag has gap {max(gaps)}, but no gap {lacking[0]}"
        faults.append(Fault(line=gaps_line, text=text))
    if len(faults) == before:
        in_order = [gaps[place] for place in sorted(gaps)]
        missing = [
            "frequency_mhz" if name == "frequency" else name
            for name in ("id", "frequency")
            if name not in draft.entries
        ]
        missing += ["burst_interval_s"] * (interval_s is None)
        missing += ["gaps (g1, g2 … or gaps_ms)"] * (not in_order)
        if in_order:
            read_code(draft, in_order, interval_s, gaps_line, interval_line, faults)
        others = _words_of_unknown(table) if missing else ""
        faults += [Fault(line=line, text=f"this tag has no {key}{others}") for key in missing]
    return draft


def _words_of_unknown(table: dict[str, tuple[str, int]]) -> str:
    """Name the columns that were passed over: one may be what is missing."""
    others = [key for key in table if key.lower() not in _NAMES and not _GAP.fullmatch(key)]
    if not others:
        return ""
    verb = "is" if len(others) == 1 else "are"
    return f"; {', '.join(key[:40] for key in others[:8])} {verb} not known here"


def _number(key: str, value: str, line: int, faults: list[Fault]) -> float | None:
    try:
        return float(value)
    except ValueError:
        faults.append(Fault(line=line, text=f"{key} is {value[:40]!r}, not a number"))
        return None
