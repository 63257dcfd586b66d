"""deploy/install.sh with a program as small as can be; it needs no network."""

import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

from command_line import program

DEPLOY = Path(__file__).parents[2] / "deploy"
PROGRAM = {
    "pyproject.toml": """
        [build-system]
        requires = ["hatchling"]
        build-backend = "hatchling.build"
        [project]
        name = "uavrt"
        version = "0.1.0"
        [project.scripts]
        uavrt = "uavrt:main"
        [tool.hatch.build.targets.wheel]
        packages = ["src/uavrt"]
        """,
    "hatch_build.py": "",
    "src/uavrt/__init__.py": "def main():\n    pass\n",
    "src/uavrt/config/__init__.py": "",
    "src/uavrt/config/loader.py": """
        from pathlib import Path

        def write_default_settings(path):
            Path(path).write_text("# settings")
        """,
}


class ToyInstaller:
    """The installer beside a source of its own, whose locks are empty."""

    def __init__(self, place: Path) -> None:
        self.root = place / "root"
        self._source = place / "source"
        for name, text in PROGRAM.items():
            (self._source / name).parent.mkdir(parents=True, exist_ok=True)
            (self._source / name).write_text(textwrap.dedent(text))
        shutil.copytree(DEPLOY, self._source / "deploy")
        for lock in (self._source / "deploy/locks").glob("*.txt"):
            lock.write_text("# nothing\n")
        self._python = place / "python"
        _write_python(self._python, place / "libraries")

    def install(
        self, *words: str, temporary: Path | None = None
    ) -> "subprocess.CompletedProcess[str]":
        """Install below `root`; temporary files lie below `temporary`."""
        inherited = {name: os.environ[name] for name in os.environ if name != "PYTHONPATH"}
        settings = {"PYTHON": str(self._python), "PIP_NO_COMPILE": "1"}
        if temporary is not None:
            settings["TMPDIR"] = str(temporary)
        script = str(self._source / "deploy/install.sh")
        return program(
            script, "--root", self.root, "--radio", "none", *words, env=inherited | settings
        )


def _write_python(path: Path, libraries: Path) -> None:
    """Write a Python whose environments have the libraries of this one, but not uavrt."""
    libraries.mkdir()
    here = Path(next(entry for entry in sys.path if entry.endswith("site-packages")))
    for library in here.iterdir():
        if "uavrt" not in library.name:
            (libraries / library.name).symlink_to(library)
    path.write_text(f"""#!/bin/sh
[ "$1 $2" = "-m venv" ] || exec {sys.executable} "$@"
{sys.executable} -m venv --without-pip "$3" &&
    for place in "$3"/lib/python3*/site-packages; do echo {libraries} >"$place/more.pth"; done
""")
    path.chmod(0o755)
