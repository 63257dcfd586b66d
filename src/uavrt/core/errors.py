"""Every error that uavrt raises on purpose.

::

    UavrtError                     catch this to catch them all
    ├── UsageError                 wrong input by the user; the text names the remedy
    │   ├── ConfigError            uavrt.toml or a command-line option
    │   ├── TagFileError           a tag file; lists all faults, each with its line
    │   ├── FormatError            a recording or log not in the declared format
    │   ├── PlanError              a search that cannot be flown: area, fence, battery, tags
    │   └── TunerError             no radio frequency serves all the tags
    ├── RadioError                 the receiver hardware or its program
    │   ├── RadioMissing           no such program or no device
    │   ├── RadioStopped           the stream ended; holds the exit reason
    │   ├── RadioStalled           runs but sends no samples
    │   └── RadioGarbled           sends data that cannot be samples
    ├── LinkError                  MAVLink: port in use, no such serial port, broken link
    ├── TunnelError                a tunnel payload that is not valid; holds the payload
    ├── PoseUnavailable            no pose is stored for a time; it may still arrive
    ├── CommandRefused             the supervisor's state does not allow it; holds the reason
    └── RecordingError             a flight directory that cannot be written or read
        └── StoreError             an object store that does not answer, or ends in the middle

Each holds the offending value where there is one, and its text says what to do.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

LONGEST_LINE = 400
"""Maximum length of a line in an error message [characters]; longer lines are shortened,
because they may quote a file."""


def _shown(text: str) -> str:
    """Shorten the lines of a text and remove control characters."""
    if not text.isprintable():
        text = "".join(one if one.isprintable() or one == "\n" else "\ufffd" for one in text)
    if len(text) <= LONGEST_LINE:
        return text
    half = LONGEST_LINE // 2
    return "\n".join(
        line if len(line) <= LONGEST_LINE else f"{line[:half]} … {line[-half:]}"
        for line in text.split("\n")
    )


class UavrtError(Exception):
    """Base class of the errors that uavrt raises on purpose.

    `message`: what is wrong, for the person who can fix it. `remedy`: what to do about it.
    """

    def __init__(self, message: str, *, remedy: str | None = None) -> None:
        self.message = message = _shown(message)
        self.remedy = remedy
        stop = "" if message.endswith(("?", "!", ".")) else "."
        super().__init__(message if remedy is None else f"{message}{stop} {remedy}")


def listed_faults(source: str, faults: Sequence[str], number: int | None = None) -> str:
    """Text with the number of faults in the file `source`, and one line for each fault.

    `number`: total number of faults, if `faults` contains only some.
    """
    number = len(faults) if number is None else number
    count = "1 fault" if number == 1 else f"{number} faults"
    return "\n  ".join((f"{source} has {count}:", *faults))


class UsageError(UavrtError):
    """Wrong input by the user."""


class NotFound(UsageError):
    """No flight, tag, format or other item has the given name; HTTP status 404."""


class ConfigError(UsageError):
    """A setting in uavrt.toml, or a command-line option, is wrong."""


class TagFileError(UsageError):
    """A tag file has faults; the text lists them all with their lines."""

    def __init__(self, path: str, faults: Sequence[str]) -> None:
        self.path = path
        self.faults = tuple(faults)
        super().__init__(
            listed_faults(path, self.faults), remedy="Correct these lines and try again"
        )


class FormatError(UsageError):
    """A recording or log does not have the declared format."""


class PlanError(UsageError):
    """A search cannot be flown because of its area, fence, battery or tags."""


class TunerError(UsageError):
    """No centre frequency of the radio covers all the tags."""


class RadioError(UavrtError):
    """The receiver hardware or its program failed."""


class RadioMissing(RadioError):
    """The radio or its program was not found."""


class RadioAmbiguous(RadioError):
    """Several radios match the settings."""


class RadioStopped(RadioError):
    """The stream of samples ended."""


class RadioStalled(RadioError):
    """The radio's program runs but delivers no samples."""


class RadioGarbled(RadioError):
    """The data from the radio's program cannot be samples."""


class LinkError(UavrtError):
    """A MAVLink link cannot be opened or has failed."""


class TunnelError(UavrtError):
    """A received tunnel payload is invalid; `message` says what is wrong."""

    def __init__(self, message: str, payload: bytes) -> None:
        self.payload = bytes(payload)
        super().__init__(message)


class PoseUnavailable(UavrtError):
    """No pose is known around a time [ns]; with `retry_later`, a pose may still arrive."""

    def __init__(self, time_ns: int, *, retry_later: bool) -> None:
        self.time_ns = time_ns
        self.retry_later = retry_later
        super().__init__(f"no pose at {time_ns} ns UTC" + (" yet" if retry_later else ""))


class CommandRefused(UavrtError):
    """The supervisor's state does not allow the command."""


class RecordingError(UavrtError):
    """A flight directory or recording cannot be written or read."""


class StoreError(RecordingError):
    """An object store does not answer or interrupts a transfer; a retry may succeed."""


@contextmanager
def needs_extra(extra: str, what: str, *, otherwise: str = "") -> Iterator[None]:
    """Context that imports optional packages; raises `UsageError` if one is not installed.

    `extra`: name of the extra that installs them, such as ``"analysis"``. `what`: function that
    needs the packages, as the start of the message. `otherwise`: what is possible without them,
    as the end of the remedy.
    """
    try:
        yield
    except ImportError as error:
        raise UsageError(
            f"{what} needs a package that is not installed ({error.name or error})",
            remedy=f"Run: pip install 'uavrt[{extra}]'{otherwise}",
        ) from error


@contextmanager
def os_errors_as(
    kind: type[UavrtError], failed: object, remedy: str | None = None
) -> Iterator[None]:
    """Context that converts `OSError` to an error of type `kind`.

    The message consists of `failed` and the system's reason.
    """
    try:
        yield
    except OSError as error:
        raise kind(f"{failed}: {error.strerror or error}", remedy=remedy) from error
