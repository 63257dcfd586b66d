"""Who logs in to the drone calls `uavrt`, as the manual has it."""

from pathlib import Path

import pytest
from toy_installer import ToyInstaller


@pytest.fixture
def toy(tmp_path: Path) -> ToyInstaller:
    return ToyInstaller(tmp_path)


def test_the_installer_puts_the_program_where_a_shell_finds_it(toy: ToyInstaller) -> None:
    command = toy.root / "usr/local/bin/uavrt"
    assert toy.install().returncode == 0
    # By way of the link that an update turns to another version.
    assert command.readlink() == toy.root / "opt/uavrt/venv/bin/uavrt"
    assert command.exists()
    made = command.lstat().st_mtime_ns
    assert toy.install().returncode == 0
    assert command.lstat().st_mtime_ns == made


def test_a_command_of_the_same_name_that_somebody_else_made_stays(toy: ToyInstaller) -> None:
    command = toy.root / "usr/local/bin/uavrt"
    command.parent.mkdir(parents=True)
    command.write_text("#!/bin/sh\n")
    done = toy.install()
    assert done.returncode == 0
    assert command.read_text() == "#!/bin/sh\n"
    assert "usr/local/bin/uavrt belongs to another program and is kept" in done.stdout
