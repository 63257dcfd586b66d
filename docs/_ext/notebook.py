"""Notebooks in the manual, without Jupyter: a parser for Sphinx, and a runner.

A page ``NAME.ipynb`` is read as MyST text: its markdown cells, its code cells, and the outputs
that are stored in it. ``python docs/_ext/notebook.py FILE …`` runs the code again and stores
what comes out; a test runs it too and compares. Outputs are text and one picture for a cell,
the figure that is called ``figure`` there.
"""

import ast
import base64
import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any


def load(path: Path) -> dict[str, Any]:
    """Read a notebook (nbformat 4)."""
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    if content["nbformat"] != 4:
        raise ValueError(f"{path} is a notebook of format {content['nbformat']}")
    return content


def as_myst(content: dict[str, Any]) -> str:
    """Write a notebook as MyST text; pictures travel as data URIs."""
    parts = []
    for cell in content["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            if output["output_type"] == "stream":
                parts.append("```text\n" + "".join(output["text"]).rstrip() + "\n```")
            elif "image/png" in output.get("data", {}):
                picture = "".join(output["data"]["image/png"].split())
                said = "".join(output["data"].get("text/plain", "figure"))
                parts.append(
                    "```{raw} html\n"
                    f'<p><img alt="{said}" src="data:image/png;base64,{picture}"></p>\n```'
                )
    return "\n\n".join(parts) + "\n"


def run(content: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """Run the code cells in order; give the outputs of each."""
    names: dict[str, Any] = {"__name__": "__main__"}
    outputs = []
    for number, cell in enumerate(content["cells"]):
        if cell["cell_type"] != "code":
            continue
        names.pop("figure", None)
        said = io.StringIO()
        code = compile("".join(cell["source"]), f"<cell {number}>", "exec", ast.PyCF_ONLY_AST)
        with contextlib.redirect_stdout(said):
            exec(compile(code, f"<cell {number}>", "exec"), names)
        outputs.append(_outputs(said.getvalue(), names.get("figure")))
    return outputs


def _outputs(text: str, figure: Any) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    if text:
        lines = text.splitlines(keepends=True)
        found.append({"output_type": "stream", "name": "stdout", "text": lines})
    if figure is not None:
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=80, metadata={"Software": None})
        data = {
            "image/png": base64.b64encode(picture.getvalue()).decode(),
            "text/plain": [str(figure.get_label() or "figure")],
        }
        found.append({"output_type": "display_data", "metadata": {}, "data": data})
    return found


def store(path: Path) -> None:
    """Run a notebook and write it with its outputs."""
    content = load(path)
    cells = [cell for cell in content["cells"] if cell["cell_type"] == "code"]
    for number, (cell, outputs) in enumerate(zip(cells, run(content), strict=True), start=1):
        cell["outputs"] = outputs
        cell["execution_count"] = number
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    path.write_text(text, encoding="utf-8")


def setup(app: Any) -> dict[str, bool]:
    """Let Sphinx read ``.ipynb``."""
    from myst_parser.parsers.sphinx_ import MystParser

    class NotebookParser(MystParser):  # type: ignore[misc]
        supported = ("ipynb",)

        def parse(self, inputstring: str, document: Any) -> None:
            super().parse(as_myst(json.loads(inputstring)), document)

    app.add_source_suffix(".ipynb", "ipynb")
    app.add_source_parser(NotebookParser)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    for name in sys.argv[1:]:
        store(Path(name))
