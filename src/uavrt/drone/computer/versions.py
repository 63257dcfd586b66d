"""The installed versions, and the link to the one that runs.

::

    /opt/uavrt/
    ├── venv -> versions/0.2.0-1f0c33a9    what the service starts
    ├── trial -> versions/source           while a new version is on trial: the previous one
    ├── update-keys.pem                    keys whose updates are accepted
    └── versions/
        ├── source/                        made by deploy/install.sh
        └── 0.2.0-1f0c33a9/                made by `uavrt update`

Each version is a separate environment, and complete before a link leads to it. A link is
replaced as a whole (rename(2)), so at every instant there is a version that runs. `trial` is
also the journal: while it exists, the new version is not accepted permanently.
"""

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

from uavrt.core.atomic_file import sync_to_disk
from uavrt.core.errors import UsageError, os_errors_as

COMPLETE = ".complete"


@dataclass(frozen=True, slots=True)
class Installation:
    """Directory that contains the installed versions, and the links to two of them."""

    prefix: Path

    @classmethod
    def of(cls, executable: str) -> "Installation | None":
        """Find the installation that contains a Python interpreter; None if none does."""
        environment = Path(executable).parent.resolve().parent
        prefix = environment.parent.parent
        if environment.parent.name != "versions" or not (prefix / "venv").is_symlink():
            return None
        return cls(prefix)

    @property
    def link(self) -> Path:
        """Link to the version that the service starts."""
        return self.prefix / "venv"

    @property
    def trial(self) -> Path:
        """Link to the previous version while a new one is on trial."""
        return self.prefix / "trial"

    @property
    def keys(self) -> Path:
        """File with the public keys whose updates are accepted."""
        return self.prefix / "update-keys.pem"

    def version_directory(self, name: str) -> Path:
        """Return the directory of the version with this name."""
        return self.prefix / "versions" / name

    def current(self) -> Path:
        """Directory of the version that the service starts; raises `UsageError`."""
        return _target(self.link, self.prefix)

    def before(self) -> Path | None:
        """Directory of the version used before the one on trial; None without a trial."""
        return _target(self.trial, self.prefix) if self.trial.is_symlink() else None

    def require(self) -> None:
        """Raise `UsageError` unless versions can be exchanged here."""
        if not self.link.is_symlink():
            raise UsageError(
                f"{self.link} is not a symbolic link to an installed version",
                remedy="Install uavrt once with deploy/install.sh of this version, then update",
            )
        if not os.access(self.prefix, os.W_OK):
            raise UsageError(
                f"{self.prefix} cannot be written", remedy="Run the command with sudo"
            )

    def point(self, link: Path, version: Path) -> None:
        """Set a link to a version, atomically and durably."""
        new = link.with_name(f".{link.name}.new")
        new.unlink(missing_ok=True)
        new.symlink_to(version.relative_to(self.prefix))
        new.replace(link)
        self.sync()

    def end_trial(self) -> None:
        """Remove the ``trial`` link, so that the running version is kept permanently."""
        self.trial.unlink(missing_ok=True)
        self.sync()

    def mark_complete(self, version: Path) -> None:
        """Mark a version as complete, once all its files are on the disk."""
        os.sync()
        (version / COMPLETE).touch()
        os.sync()

    def sync(self) -> None:
        """Sync the links to the disk."""
        sync_to_disk(self.prefix)

    def remove_others(self, *kept: Path) -> None:
        """Delete all versions except `kept`, and the remains of an interrupted update."""
        for path in (self.prefix / "versions").iterdir():
            if path not in kept:
                shutil.rmtree(path, ignore_errors=True)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Context in which no other program exchanges versions; raises `UsageError`."""
        with open(self.prefix / ".update-lock", "w", encoding="ascii") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                remedy = "Wait until it has ended"
                raise UsageError("another update is in progress", remedy=remedy) from None
            yield


def runs_from(process_id: int, environment: Path) -> bool:
    """True if a process runs the Python of the given environment."""
    try:
        words = Path(f"/proc/{process_id}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False
    return Path(os.fsdecode(words[0])).parent.resolve() == (environment / "bin").resolve()


def version_of(environment: Path) -> str:
    """Return the version of uavrt in an environment; `UsageError` if it is not installed."""
    for place in environment.glob("lib/python3*/site-packages"):
        for found in distributions(name="uavrt", path=[str(place)]):
            return found.version
    raise UsageError(f"uavrt is not installed in {environment}", remedy="Run deploy/install.sh")


def _target(link: Path, prefix: Path) -> Path:
    with os_errors_as(UsageError, f"{link}", "Run deploy/install.sh"):
        return prefix / link.readlink()
