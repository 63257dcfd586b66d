"""A refusal reaches the operator whole, with its remedy: a message has room for 108 bytes."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import uavrt
from uavrt.core.errors import CommandRefused, PlanError
from uavrt.link.tunnel.own_messages.motion_messages import MAX_TEXT
from uavrt.planning.area import Polygon, SearchArea

ROOT = Path(uavrt.__file__).parent
REFUSING = (
    *sorted((ROOT / "guidance").rglob("*.py")),
    *(ROOT / "drone/processes" / name for name in ("guide.py", "motions/motion_handler.py")),
    *(ROOT / "planning" / name for name in ("area.py", "search.py")),
)
ERRORS = (PlanError.__name__, CommandRefused.__name__)
VALUE = "1234"
"""As long as most of what is filled in."""


def words(node: ast.expr) -> str:
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(map(words, parts))
    return VALUE


def refusals(path: Path) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ERRORS:
            remedy = [words(one.value) for one in node.keywords if one.arg == "remedy"]
            yield node.lineno, ". ".join([*map(words, node.args), *remedy])


@pytest.mark.parametrize("path", REFUSING, ids=lambda path: path.name)
def test_a_refusal_fits_into_the_message_that_tells_it(path: Path) -> None:
    long = [one for one in refusals(path) if len(one[1].encode()) > MAX_TEXT]
    assert not long


def test_enough_refusals_are_looked_at() -> None:
    assert sum(len(list(refusals(path))) for path in REFUSING) > 60


def test_an_area_beyond_the_fence_tells_of_a_few_corners_and_how_many_more() -> None:
    corners = tuple((1000.0 + 20.0 * n, 30.0 * (n % 2) + n * n) for n in range(10))
    outline = (*corners, *((x, y + 5000.0) for x, y in reversed(corners)))
    fence = Polygon.rectangle(-500.0, 500.0, -500.0, 500.0, name="fence")
    with pytest.raises(PlanError) as refused:
        SearchArea(search=Polygon(corners=outline, name="area"), fence=fence)
    assert str(refused.value) == (
        "the area lies beyond the fence at its corners 1, 2, 3 and 17 more. "
        "Draw it inside, or widen the fence"
    )
    triangle = Polygon(corners=((0.0, 0.0), (400.0, 0.0), (0.0, 600.0)), name="area")
    with pytest.raises(PlanError, match=r"at its corner 3\. Draw"):
        SearchArea(search=triangle, fence=fence)
