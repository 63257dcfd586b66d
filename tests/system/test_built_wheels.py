"""What deploy/install.sh had to build on 64-bit ARM is there after an update, too."""

import zipfile
from pathlib import Path

from update_maker import TINY, make_installation, make_key, write_update, write_wheel

from uavrt.drone.computer import update
from uavrt.drone.computer.versions import Installation

INFO = "cyclonedds-0.10.5.dist-info"
BINDING = {
    "cyclonedds/__init__.py": "",
    f"{INFO}/METADATA": "Metadata-Version: 2.1\nName: cyclonedds\nVersion: 0.10.5\n",
    f"{INFO}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    f"{INFO}/RECORD": "",
}


def test_a_version_whose_update_has_no_dds_binding_gets_the_one_that_was_built(
    tmp_path: Path,
) -> None:
    secret, public = make_key(tmp_path, "release")
    prefix = tmp_path / "opt"
    make_installation(prefix, write_wheel(tmp_path, "0.1.0", TINY), public)
    place = Installation(prefix)
    built = prefix / "wheels/cyclonedds-0.10.5-py3-none-any.whl"
    built.parent.mkdir()
    with zipfile.ZipFile(built, "w") as wheel:
        for name, content in BINDING.items():
            wheel.writestr(name, content)
    (packages,) = place.current().glob("lib/python3*/site-packages")
    with zipfile.ZipFile(built) as wheel:
        wheel.extractall(packages)
    whole = write_update(
        tmp_path / "uavrt-0.2.0.tar", write_wheel(tmp_path, "0.2.0", TINY), secret
    )
    found = update.check(whole, place)
    made = update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert list(made.glob(f"lib/python3*/site-packages/{INFO}/METADATA"))
