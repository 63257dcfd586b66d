"""Outcomes of finished trials in a file, so that a long experiment can be continued."""

import json
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from uavrt.core.errors import FormatError, RecordingError, UsageError


class KeptOutcomes:
    """Outcomes by the names of their trials; with a file, each is written at once.

    A trial's outcome must depend only on its name and on `made_with`. The file has a line of
    JSON for each; a last line broken by a crash is cut off.

    `path`: created if missing; None keeps the outcomes in memory.
    `made_with`: seed, code and everything else that the outcomes depend on.
    Raises `UsageError`: the file's outcomes were made with something else.
    Raises `FormatError`: the file does not contain outcomes.
    Raises `RecordingError`: it cannot be read or written.
    """

    def __init__(self, path: Path | None = None, *, made_with: str = "") -> None:
        self._outcomes: dict[str, Any] = {}
        self._file: IO[bytes] | None = None
        if path is None:
            return
        try:
            self._file = path.open("a+b")
            self._begin(path, made_with)
        except OSError as error:
            self.close()
            raise RecordingError(
                f"cannot keep outcomes in {path}: {error.strerror}",
                remedy="Give another place with --kept or --output",
            ) from error
        except UsageError:
            self.close()
            raise

    def __enter__(self) -> "KeptOutcomes":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the outcomes' file."""
        if self._file is not None:
            self._file.close()

    def take(self, name: str, trial: Callable[[], Any]) -> Any:
        """Get the outcome of a trial; run it if it is not stored yet.

        `trial`: returns a value that JSON can represent.
        """
        if name not in self._outcomes:
            outcome = trial()
            if self._file is not None:
                self._write({"trial": name, "outcome": outcome})
            self._outcomes[name] = outcome
        return self._outcomes[name]

    def __contains__(self, name: str) -> bool:
        return name in self._outcomes

    def of(self, beginning: str) -> list[Any]:
        """Outcomes of all trials whose names begin with a text."""
        return [one for name, one in self._outcomes.items() if name.startswith(beginning)]

    def _write(self, record: dict[str, Any]) -> None:
        assert self._file is not None
        self._file.write(json.dumps(record).encode() + b"\n")
        self._file.flush()

    def _begin(self, path: Path, made_with: str) -> None:
        """Read the complete lines of the file, and cut off the rest."""
        assert self._file is not None
        self._file.seek(0)
        *lines, _ = self._file.read().split(b"\n")
        try:
            records = [json.loads(line) for line in lines]
            made = records[0]["made_with"] if records else made_with
            self._outcomes = {one["trial"]: one["outcome"] for one in records[1:]}
        except (ValueError, KeyError, TypeError) as error:
            raise FormatError(
                f"{path} does not hold outcomes of an experiment",
                remedy="Give another place with --kept or --output",
            ) from error
        if made != made_with:
            raise UsageError(
                f"the outcomes in {path} were made with {made}, and this is {made_with}",
                remedy="Give another place with --kept or --output",
            )
        self._file.truncate(sum(len(line) + 1 for line in lines))
        if not lines:
            self._write({"made_with": made_with})
