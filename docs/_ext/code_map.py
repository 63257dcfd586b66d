"""Write the table of `docs/explanation/where-does-it-live.md` from the source tree.

Packages and their order come from the layers in ``pyproject.toml``, texts from the docstrings
of the packages and modules. Run it after a change of either; a test compares.
"""

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src/uavrt"
PAGE = ROOT / "docs/explanation/where-does-it-live.md"
BEGIN, END = "<!-- written by docs/_ext/code_map.py -->\n", "<!-- end -->\n"


def layers() -> list[list[str]]:
    """Return the names in each layer of `uavrt`, the highest first."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for one in contracts["tool"]["importlinter"]["contracts"]:
        if one.get("containers") == ["uavrt"]:
            return [re.findall(r"\w+", layer) for layer in one["layers"]]
    raise LookupError("pyproject.toml has no layers of uavrt")


def text_of(module: Path, *, whole: bool) -> str:
    """Return a module's docstring in one line of Markdown, or its first sentence alone."""
    lines = ast.get_docstring(ast.parse(module.read_text(encoding="utf-8"))) or ""
    shown = lines if whole else lines.partition("\n\n")[0]
    return " ".join(shown.replace("``", "`").replace("|", "\\|").split())


def table() -> str:
    """Return the table: level, package, its docstring; folders below their package."""
    order = layers()
    rows = ["| level | package | what lives there |", "|---|---|---|"]
    for level, names in zip(range(len(order), 0, -1), order, strict=True):
        for name in names:
            package = SOURCE / name / "__init__.py"
            module = package if package.exists() else SOURCE / f"{name}.py"
            whole = module is package
            rows.append(f"| {level} | `{name}` | {text_of(module, whole=whole)} |")
            if whole:
                for folder in sorted((SOURCE / name).glob("**/*/__init__.py")):
                    below = folder.parent.relative_to(SOURCE).as_posix()
                    rows.append(f"| | `{below}` | {text_of(folder, whole=True)} |")
    return "\n".join(rows) + "\n"


def written(page: str) -> str:
    """Return the page with its table replaced by the present one."""
    before, _, rest = page.partition(BEGIN)
    after = rest.partition(END)[2]
    return f"{before}{BEGIN}\n{table()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
