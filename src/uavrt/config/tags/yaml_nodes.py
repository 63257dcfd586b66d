"""Read YAML lists of tags with PyYAML, as nodes with line numbers.

Numbers remain text as typed, since the reader of the tag list determines their types. Aliases
(``*``) are rejected because a few bytes of them can expand to gigabytes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from uavrt.config.tags.tag_drafts import Fault
from uavrt.core.errors import needs_extra
from uavrt.core.foreign import YAML_TAGS

_NULL = "tag:yaml.org,2002:null"


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A YAML value and its line number; null is None."""

    line: int
    value: "str | list[Node] | dict[str, Node] | None"


def read_yaml(text: str, faults: list[Fault]) -> list[Node]:
    """Read YAML documents up to the first error in syntax; errors are added to `faults`."""
    with needs_extra(
        "ground",
        "a list in YAML",
        otherwise=", or make a tags.toml of it on another computer: uavrt tags convert",
    ):
        import yaml
    found: list[Node] = []
    if len(text) > YAML_TAGS.bytes:
        fault = (
            f"the text has {len(text):,} characters; {YAML_TAGS.what} can have at most "
            f"{YAML_TAGS.bytes:,}"
        )
        faults.append(Fault(line=1, text=fault))
        return found
    try:
        found.extend(_node(document, faults) for document in _documents(yaml, text))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        fault = " ".join(part for part in (error.context, error.problem) if part)
        line = mark.line + 1 if mark is not None else 1
        faults.append(Fault(line=line, text=f"not YAML: {fault}"))
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        faults.append(Fault(line=line, text="not YAML: it contains a control character"))
    return found


def _documents(yaml: Any, text: str) -> Iterator[Any]:
    """Yield each YAML document as a tree of nodes; documents nested too deeply are rejected
    before their nodes are created.
    """

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # it has no types
        depth = nodes = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            fault = None
            if self.check_event(yaml.AliasEvent):
                fault = "aliases (*) are not supported: write the value itself"
            elif self.depth > YAML_TAGS.depth:
                fault = "nested too deeply for a list of tags"
            elif self.nodes >= YAML_TAGS.values:
                fault = "more values than a list of tags may have"
            if fault is not None:
                mark = self.peek_event().start_mark
                raise yaml.composer.ComposerError(None, None, fault, mark)
            self.nodes += 1
            self.depth += 1
            node = super().compose_node(parent, index)
            self.depth -= 1
            return node

    yield from yaml.compose_all(text, Loader=Loader)


def _node(found: Any, faults: list[Fault]) -> Node:
    line = found.start_mark.line + 1
    if found.id == "scalar":
        return Node(line=line, value=None if found.tag == _NULL else found.value)
    if found.id == "sequence":
        items = [_node(one, faults) for one in found.value]
        return Node(line=line, value=items)
    pairs: dict[str, Node] = {}
    for key, value in found.value:
        at = key.start_mark.line + 1
        if key.id != "scalar":
            faults.append(Fault(line=at, text="a key is a list or a mapping instead of a name"))
            continue
        if key.value in pairs:
            faults.append(Fault(line=at, text=f"{key.value[:40]} is given twice"))
        pairs[key.value] = _node(value, faults)
    return Node(line=line, value=pairs)
