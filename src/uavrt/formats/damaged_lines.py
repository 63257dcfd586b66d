"""Skip and report damaged lines of a pulse log, unless most lines are unreadable."""

from collections.abc import Callable

from uavrt.core.earth.on_earth import OffEarthError
from uavrt.core.errors import FormatError
from uavrt.core.log import get_logger

log = get_logger()


class DamagedLines:
    """Collects the unreadable lines of one file and reports them to `warn` or to the log."""

    def __init__(
        self, name: str, remedy: str, warn: Callable[[str], None] | None = None
    ) -> None:
        self._name, self._remedy, self._warn = name, remedy, warn
        self._faults: list[tuple[int, Exception]] = []

    def add(self, number: int, reason: Exception) -> None:
        """Add the number of an unreadable line and the reason."""
        self._faults.append((number, reason))

    def report(self, good: int) -> None:
        """Report the skipped lines; raises `FormatError` if they outnumber the valid ones."""
        if not self._faults:
            return
        number, error = self._faults[0]
        reason, remedy = reason_of(error)
        if len(self._faults) > good:
            raise FormatError(
                f"{self._name} line {number} is not a pulse: {reason}",
                remedy=remedy or self._remedy,
            )
        if self._warn is not None:
            self._warn(passed_over(self._name, len(self._faults), number, error))
            return
        log.warning(
            "damaged lines skipped",
            file=self._name,
            lines=len(self._faults),
            first=number,
            reason=reason,
        )


def passed_over(name: str, lines: int, first: int, error: object) -> str:
    """Warning with the number of skipped lines and the reason for the first of them."""
    reason, remedy = reason_of(error)
    count = "1 damaged line was" if lines == 1 else f"{lines} damaged lines were"
    which = f"line {first}" if lines == 1 else f"the first is line {first}"
    return f"{name}: {count} skipped ({which}: {reason})." + (
        "" if remedy is None else f" {remedy}."
    )


def reason_of(error: object) -> tuple[str, str | None]:
    """Reason why a line cannot be read, and the remedy; None if the error has no remedy."""
    if isinstance(error, OffEarthError):
        return str(error), error.remedy
    return str(error), None
