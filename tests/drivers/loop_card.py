"""A small memory card: an ext4 in a file, mounted as Debian mounts a card."""

import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import program
from until import until

CARD_MB = 32


class LoopCard:
    """It can be mounted, made to fail, and checked as at boot."""

    def __init__(self, directory: Path) -> None:
        self.image, self.place = directory / "card.img", directory / "card"
        self.place.mkdir()
        with open(self.image, "wb") as file:
            file.truncate(CARD_MB * 1_000_000)
        self._run("mkfs.ext4", "-q", "-m", "0", str(self.image))
        self.mount()

    def mount(self, access: str = "rw") -> None:
        """Mount it, or with "ro" as a card that takes nothing any more."""
        options = f"loop,{access},errors=remount-ro"
        self._run("mount", "-t", "ext4", "-o", options, str(self.image), str(self.place))

    def unmount(self) -> None:
        self._run("umount", str(self.place))
        # The kernel releases the loop device after umount returns; a mount before fails.
        until(
            lambda: not self._run("losetup", "-n", "-O", "NAME", "-j", str(self.image)).strip()
        )

    def fail(self) -> None:
        """Let the kernel meet an error, as with a card that is failing."""
        said = self._run("losetup", "-n", "-O", "NAME", "-j", str(self.image))
        name = Path(said.strip()).name
        Path(f"/sys/fs/ext4/{name}/trigger_fs_error").write_text("1")

    def check(self) -> None:
        """Do what a computer does at boot (e2fsck(8); 1: errors were corrected)."""
        finished = subprocess.run(["e2fsck", "-p", str(self.image)], check=False)
        assert finished.returncode in (0, 1)

    @staticmethod
    def _run(*command: str) -> str:
        done = program(*command, check=True)
        return done.stdout


def loop_card(directory: Path) -> Iterator[LoopCard]:
    """Make one for a fixture, below a directory or in memory; skips where nobody may mount."""
    memory = Path("/dev/shm")  # a flush of a real disk takes longer than all else here
    try:
        made = LoopCard(Path(tempfile.mkdtemp(dir=memory if memory.is_dir() else directory)))
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", "") or str(error)
        pytest.skip(f"a file cannot be mounted here (needs root and a loop device): {said}")
    yield made
    subprocess.run(["umount", "--lazy", str(made.place)], check=False)
    made.image.unlink()
    made.place.rmdir()
    made.place.parent.rmdir()
