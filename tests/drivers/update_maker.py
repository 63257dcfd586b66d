"""Versions, wheels and signed updates, as deploy/make-update.py writes them."""

import hashlib
import io
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

from command_line import program

ROOT = Path(__file__).parents[2]
MAKER = ROOT / "deploy/make-update.py"
TINY = {
    "uavrt/__init__.py": "",
    "uavrt/cli/__init__.py": "def main():\n    pass\n",
    "uavrt/cli/__main__.py": "from importlib.metadata import version as v\nprint(v('uavrt'))\n",
}
"""All that the rehearsal of a version needs."""


def make_key(directory: Path, name: str) -> tuple[Path, str]:
    """Make a key; the file of its secret, and its public half."""
    secret = directory / f"{name}.pem"
    command = ["openssl", "genpkey", "-algorithm", "ed25519", "-out", str(secret)]
    subprocess.run(command, check=True, capture_output=True)
    shown = program("openssl", "pkey", "-in", secret, "-pubout", check=True)
    return secret, shown.stdout


def write_wheel(directory: Path, version: str, files: Mapping[str, str | bytes]) -> Path:
    """Write a pure wheel of uavrt."""
    info = f"uavrt-{version}.dist-info"
    whole = {
        **files,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: uavrt\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": "[console_scripts]\nuavrt = uavrt.cli:main\n",
    }
    whole[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in (*whole, f"{info}/RECORD"))
    path = directory / f"uavrt-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in whole.items():
            archive.writestr(name, content)
    return path


def whole_program(version: str, change: Callable[[str, str], str]) -> dict[str, str | bytes]:
    """Get the files of this source as another version; `change` may spoil some."""
    files: dict[str, str | bytes] = {}
    for path in sorted((ROOT / "src/uavrt").rglob("*")):
        name = path.relative_to(ROOT / "src").as_posix()
        if path.suffix == ".py":
            files[name] = change(name, path.read_text(encoding="utf-8"))
        elif path.suffix in (".so", ".toml", ".xml"):
            files[name] = path.read_bytes()
    files["uavrt/__init__.py"] = f'"""uavrt."""\n\n__version__ = "{version}"\n'
    return files


def write_update(output: Path, wheel: Path, key: Path, keys: Path | None = None) -> Path:
    """Write a signed update of a wheel without libraries."""
    libraries = output.parent / "no-libraries"
    libraries.mkdir(exist_ok=True)
    words = [str(wheel), "--key", str(key), "-o", str(output), "--libraries", str(libraries)]
    words += [] if keys is None else ["--keys", str(keys)]
    subprocess.run([sys.executable, str(MAKER), *words], check=True)
    return output


def sign_alone(wheel: Path, key: Path) -> Path:
    """Write the signature of a wheel beside it."""
    words = [str(wheel), "--key", str(key), "--alone"]
    subprocess.run([sys.executable, str(MAKER), *words], check=True)
    return wheel


def make_environment(environment: Path, wheel: Path) -> None:
    """Make an environment with a wheel of uavrt, and this one's libraries (pip is one)."""
    subprocess.run(
        [sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True
    )
    place = next(environment.glob("lib/python3*/site-packages"))
    here = Path(next(path for path in sys.path if path.endswith("site-packages")))
    (place / "libraries.pth").write_text(f"{here}\n", encoding="utf-8")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place)
    script = environment / "bin/uavrt"
    script.write_text(
        f"#!{environment}/bin/python\nfrom uavrt.cli.__main__ import main\nmain()\n",
        encoding="utf-8",
    )
    script.chmod(0o755)


def make_installation(prefix: Path, wheel: Path, keys: str) -> None:
    """Make what deploy/install.sh leaves: one version, the link, the keys."""
    make_environment(prefix / "versions/source", wheel)
    (prefix / "venv").symlink_to("versions/source")
    (prefix / "update-keys.pem").write_text(keys, encoding="ascii")
    (prefix / "update-keys.pem").chmod(0o644)


def digest_below(directory: Path) -> str:
    """Names, contents and times of all files below a directory."""
    said = io.BytesIO()
    for path in sorted(directory.rglob("*")):
        about = path.lstat()
        said.write(
            f"{path.relative_to(directory)} {about.st_mtime_ns} {about.st_mode}".encode()
        )
        if path.is_file() and not path.is_symlink():
            said.write(hashlib.sha256(path.read_bytes()).digest())
    return hashlib.sha256(said.getvalue()).hexdigest()
