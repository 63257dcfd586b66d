"""The manual's notebooks run, and say what is stored in them."""

import re
from pathlib import Path
from typing import Any

import pytest
from by_path import module_at

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOKS = sorted(path for path in DOCS.rglob("*.ipynb") if "_build" not in path.parts)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def said(outputs: list[dict[str, Any]]) -> str:
    return "".join("".join(one["text"]) for one in outputs if one["output_type"] == "stream")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_says_what_is_stored_in_it(path: Path) -> None:
    """Word for word; numbers to 5 %, since another NumPy may round otherwise."""
    module = module_at(DOCS / "_ext/notebook.py")
    content = module.load(path)
    cells = [cell for cell in content["cells"] if cell["cell_type"] == "code"]
    for cell, now in zip(cells, module.run(content), strict=True):
        before, after = said(cell["outputs"]), said(now)
        assert NUMBER.sub("#", after) == NUMBER.sub("#", before)
        for old, new in zip(NUMBER.findall(before), NUMBER.findall(after), strict=True):
            assert float(new) == pytest.approx(float(old), rel=0.05, abs=0.3)
        kinds = [one["output_type"] for one in cell["outputs"]]
        assert [one["output_type"] for one in now] == kinds


def test_there_is_a_notebook_and_it_becomes_a_page_that_fetches_nothing() -> None:
    assert NOTEBOOKS
    module = module_at(DOCS / "_ext/notebook.py")
    for path in NOTEBOOKS:
        page = module.as_myst(module.load(path))
        assert page.startswith("# ")
        assert page.count("```python") >= 5
        assert "data:image/png;base64," in page
        assert "http" not in page
        assert path.stat().st_size < 150_000
