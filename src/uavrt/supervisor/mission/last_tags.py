"""The last tags sent: a file beside the flights that survives every stop and restart.

A ground station that cannot send tags starts detection with these (`DET_RUN`).
"""

from collections.abc import Iterable
from pathlib import Path

import msgspec

from uavrt.atomic_file import write_atomically
from uavrt.log import get_logger
from uavrt.messages import Tag

log = get_logger()

LAST_TAGS_NAME = "last_tags.json"


class LastTags:
    """The file.

    Parameters
    ----------
    directory : Path
        Where flight directories are made.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / LAST_TAGS_NAME

    def keep(self, tags: Iterable[Tag]) -> None:
        """Keep tags in place of those before; a disk that cannot be written costs only that."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            text = msgspec.json.format(msgspec.json.encode((*tags,))).decode()
            write_atomically(self._path, text + "\n")
        except OSError as error:
            log.warning("tags not kept over a restart", reason=str(error.strerror))

    def read(self) -> tuple[Tag, ...]:
        """Get them; none when there are none that can be read. They are not checked."""
        try:
            return msgspec.json.decode(self._path.read_bytes(), type=tuple[Tag, ...])
        except FileNotFoundError:
            return ()
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            log.warning("last tags not read", reason=str(error))
            return ()
