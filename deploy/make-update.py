"""Make a signed update for ``uavrt update``.

    python deploy/make-update.py --key release.pem -o uavrt-0.2.0.tar dist/*.whl
    python deploy/make-update.py --key release.pem --alone dist/uavrt-0.2.0-py3-none-any.whl

The first writes the program and all its libraries into one file. Libraries are the wheels in
``--libraries DIR``; without it pip fetches those of deploy/locks/drone-page.txt, which the
drone side and the page need, for 64-bit ARM (``--machine``, ``--python``). The second writes
the signature of a wheel alone beside it. ``--keys FILE`` lets the public keys in FILE count
from then on, instead of those before. A key is made by

    openssl genpkey -algorithm ed25519 -out release.pem
    openssl pkey -in release.pem -pubout -out update-keys.pem

Needs the ``uavrt`` of this source (``.venv/bin/python``) and openssl 3.
"""

import argparse
import hashlib
import io
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import msgspec

from uavrt.drone.computer.update_file import (
    FORMAT,
    MANIFEST,
    SIGNATURE,
    WHEELS,
    Manifest,
    Wheel,
)

LOCK = Path(__file__).parent / "locks" / "drone-page.txt"
"""With the page: a drone whose image serves it must still do so with the next version."""


def signed(content: bytes, key: Path) -> bytes:
    """Sign with an Ed25519 key."""
    with tempfile.NamedTemporaryFile() as file:
        file.write(content)
        file.flush()
        command = [
            "openssl",
            "pkeyutl",
            "-sign",
            "-rawin",
            "-inkey",
            str(key),
            "-in",
            file.name,
        ]
        return subprocess.run(command, capture_output=True, check=True).stdout


def fetch_libraries(directory: Path, machine: str, python: str) -> None:
    """Fetch what the drone needs, for its processor; hashes as locked."""
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in (34, 28, 17)]
    chosen = [word for name in platforms for word in ("--platform", name)]
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--only-binary=:all:"),
            *("--no-deps", "--require-hashes", "-r", str(LOCK), "--dest", str(directory)),
            *("--implementation", "cp", "--python-version", python, *chosen),
        ],
        check=True,
    )


def write_update(output: Path, wheels: list[Path], key: Path, keys: str | None) -> None:
    """Write the archive: the same wheels and key give the same bytes."""
    ours = {path.name.split("-")[1] for path in wheels if path.name.startswith("uavrt-")}
    if len(ours) != 1:
        sys.exit(f"one version of uavrt is needed, not {sorted(ours)}")
    wheels = sorted(wheels, key=lambda path: path.name)
    contents = {f"{WHEELS}/{path.name}": path.read_bytes() for path in wheels}
    files = tuple(
        Wheel(Path(name).name, len(content), hashlib.sha256(content).hexdigest())
        for name, content in contents.items()
    )
    manifest = msgspec.json.format(
        msgspec.json.encode(
            Manifest(format=FORMAT, version=ours.pop(), files=files, keys=keys)
        ),
        indent=1,
    )
    contents = {MANIFEST: manifest, SIGNATURE: signed(manifest, key), **contents}
    with tarfile.open(output, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in contents.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))


def main() -> None:
    """Make what the arguments ask for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("wheels", nargs="+", type=Path)
    parser.add_argument("--key", type=Path, required=True)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--libraries", type=Path)
    parser.add_argument("--machine", default="aarch64")
    parser.add_argument("--python", default="3.11")
    parser.add_argument("--keys", type=Path)
    parser.add_argument("--alone", action="store_true")
    given = parser.parse_args()
    if given.alone:
        for wheel in given.wheels:
            wheel.with_name(f"{wheel.name}.sig").write_bytes(
                signed(wheel.read_bytes(), given.key)
            )
        return
    if given.output is None:
        parser.error("-o FILE.tar, or --alone")
    keys = None if given.keys is None else given.keys.read_text(encoding="ascii")
    with tempfile.TemporaryDirectory() as name:
        libraries = given.libraries or Path(name)
        if given.libraries is None:
            fetch_libraries(libraries, given.machine, given.python)
        wheels = [*given.wheels, *libraries.glob("*.whl")]
        write_update(given.output, wheels, given.key, keys)


if __name__ == "__main__":
    main()
