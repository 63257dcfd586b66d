"""Skip and report log lines that are not pulses, unless the file is not a log at all."""

from uavrt.errors import FormatError
from uavrt.log import get_logger

log = get_logger()


class DamagedLines:
    """Collects the unreadable lines of one file.

    Parameters
    ----------
    name : str
        The file.
    remedy : str
        What to do when it is no such file.
    """

    def __init__(self, name: str, remedy: str) -> None:
        self._name, self._remedy = name, remedy
        self._faults: list[tuple[int, str]] = []

    def add(self, number: int, reason: Exception) -> None:
        """Add a line that is no pulse."""
        self._faults.append((number, str(reason)))

    def judge(self, good: int) -> None:
        """Return how many lines were passed over beside the good ones.

        Raises
        ------
        FormatError
            There are more of them than good ones: the file is another.
        """
        if not self._faults:
            return
        number, reason = self._faults[0]
        if len(self._faults) > good:
            raise FormatError(
                f"{self._name} line {number} is not a pulse: {reason}", remedy=self._remedy
            )
        log.warning(
            "damaged lines passed over",
            file=self._name,
            lines=len(self._faults),
            first=number,
            reason=reason,
        )
