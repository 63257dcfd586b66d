"""Open any source of samples: a radio, a pipe or a recording."""

from collections.abc import Callable
from pathlib import Path, PurePath
from typing import Literal

from uavrt.config.settings import RADIO_GROUP, RadioSettings
from uavrt.core.clock import Clock
from uavrt.core.errors import FormatError
from uavrt.core.plugins import Registry
from uavrt.radio.channels.channel_source import ChannelDatagramSource
from uavrt.radio.files.file_names import NameFacts, read_name
from uavrt.radio.files.recording_source import (
    GIVEN_BY_USER,
    Layout,
    RecordingSource,
    file_size,
    name_note,
    raw_layout,
)
from uavrt.radio.files.sigmf import sigmf_layout
from uavrt.radio.files.wav import wav_layout
from uavrt.radio.formats import FORMATS, sample_format
from uavrt.radio.receivers.radio_program import ProgramSource
from uavrt.radio.receivers.radio_programs import PROGRAMS
from uavrt.radio.receivers.soapy import SoapySource
from uavrt.radio.sample_stream import StreamSource
from uavrt.radio.source import SampleSource

RadioOpener = Callable[[RadioSettings, float, Clock | None], SampleSource]


OPENERS: Registry[RadioOpener] = Registry(RADIO_GROUP, {"soapy": SoapySource})
"""Functions that open a radio through a driver, by kind of radio; other packages can add
entries. Arguments: settings, frequency to which the radio is tuned [Hz] and clock."""

_SUFFIXES: dict[str, str] = {
    ".cf32": "cf32",
    ".cfile": "cf32",
    ".fc32": "cf32",
    ".cs16": "cs16",
    ".sc16": "cs16",
    ".cu8": "cu8",
    ".cs8": "ci8",
    ".ci8": "ci8",
    ".sigmf-meta": "sigmf",
    ".sigmf-data": "sigmf",
    ".sigmf": "sigmf",
    ".wav": "wav",
    ".rf64": "wav",
}


def open_radio(
    settings: RadioSettings, center_frequency_hz: float, *, clock: Clock | None = None
) -> SampleSource:
    """Start the configured radio, tuned to `center_frequency_hz`, and return its samples."""
    if settings.kind in OPENERS and settings.kind not in PROGRAMS:
        return OPENERS[settings.kind](settings, center_frequency_hz, clock)
    return ProgramSource(settings, center_frequency_hz, clock=clock)


def open_stream(
    descriptor: int,
    format_name: str | None,
    *,
    sample_rate_hz: float | None,
    center_frequency_hz: float | None,
    start_time_ns: int | None = None,
    clock: Clock | None = None,
) -> StreamSource:
    """Read live samples from a pipe.

    Raises `FormatError` if the sample rate or the radio frequency is not given.
    """
    name = "cf32" if format_name is None else format_name.lower()
    if name in ("sigmf", "wav"):
        raise FormatError(
            f"{name} cannot be read from a pipe",
            remedy=f"Name the file, or pipe raw samples: --format {'|'.join(FORMATS)}",
        )
    stored = sample_format(name)
    return StreamSource(
        descriptor,
        stored,
        sample_rate_hz=_required(sample_rate_hz, "sample-rate", "standard input"),
        center_frequency_hz=_required(
            center_frequency_hz, "center-frequency", "standard input"
        ),
        start_time_ns=start_time_ns,
        clock=clock,
    )


def open_channel(
    address: str, *, sample_rate_hz: float | None, center_frequency_hz: float | None
) -> ChannelDatagramSource:
    """Receive one channel by UDP, from the original channelizer or from uavrt."""
    return ChannelDatagramSource(
        address,
        sample_rate_hz=3750.0 if sample_rate_hz is None else sample_rate_hz,
        center_frequency_hz=_required(center_frequency_hz, "center-frequency", address),
    )


def open_recording(
    path: Path,
    format_name: str | None = None,
    *,
    sample_rate_hz: float | None = None,
    center_frequency_hz: float | None = None,
    start_time_ns: int | None = None,
) -> RecordingSource:
    """Open a recording; an option is needed only if the file does not state its value.

    `path`: the file; for SigMF either of its two files, or their common name. `format_name`:
    ``cf32``, ``cs16``, ``cu8``, ``ci8``, ``sigmf`` or ``wav``; None: the file's name shows it.
    `sample_rate_hz`, `center_frequency_hz`: needed for raw files whose name does not contain
    them. A given rate must equal the rate in the file; a given frequency replaces that in the
    file. `start_time_ns`: time of the first sample [ns, UTC]. Raises `FormatError` if the file
    is unreadable or has another format.
    """
    layout = _layout(
        path,
        format_name,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=center_frequency_hz,
        start_time_ns=start_time_ns,
    )
    if sample_rate_hz is not None and sample_rate_hz != layout.sample_rate_hz:
        raise FormatError(
            f"{path} states {layout.sample_rate_hz:.0f} samples a second, but "
            f"--sample-rate is {sample_rate_hz:.0f}",
            remedy="Omit --sample-rate",
        )
    return RecordingSource(layout)


def _layout(
    path: Path,
    format_name: str | None,
    *,
    sample_rate_hz: float | None,
    center_frequency_hz: float | None,
    start_time_ns: int | None,
) -> Layout:
    named = read_name(path) or NameFacts(program="")
    kind: str | Literal["sigmf", "wav"] | None = (
        format_name.lower() if format_name else _guess(path) or named.format_name
    )
    if kind == "sigmf":
        return sigmf_layout(
            path, center_frequency_hz=center_frequency_hz, start_time_ns=start_time_ns
        )
    if kind == "wav":
        return wav_layout(
            path, center_frequency_hz=center_frequency_hz, start_time_ns=start_time_ns
        )
    if kind is None:
        file_size(path)  # a missing file is the more helpful error
        raise FormatError(
            f"the name of {path} does not show its format",
            remedy=f"Give --format: {', '.join(FORMATS)}, sigmf or wav",
        )
    stored = sample_format(kind)
    file_size(path)
    return raw_layout(
        path,
        stored,
        sample_rate_hz=_required(
            named.sample_rate_hz if sample_rate_hz is None else sample_rate_hz,
            "sample-rate",
            str(path),
        ),
        center_frequency_hz=_required(
            named.center_frequency_hz if center_frequency_hz is None else center_frequency_hz,
            "center-frequency",
            str(path),
        ),
        start_time_ns=named.start_time_ns if start_time_ns is None else start_time_ns,
        frequency_from=name_note(named, "frequency")
        if center_frequency_hz is None
        else GIVEN_BY_USER,
        rate_from=name_note(named, "rate") if sample_rate_hz is None else GIVEN_BY_USER,
        start_from=name_note(named, "time") if start_time_ns is None else GIVEN_BY_USER,
    )


def reveals_format(path: PurePath) -> bool:
    """True if a file's name shows the format of its samples."""
    named = read_name(path)
    return path.suffix.lower() in _SUFFIXES or (
        named is not None and named.format_name is not None
    )


def _guess(path: Path) -> str | None:
    found = _SUFFIXES.get(path.suffix.lower())
    if found is None and Path(f"{path}.sigmf-meta").exists():
        return "sigmf"
    return found


def _required(value: float | None, option: str, what: str) -> float:
    if value is None:
        raise FormatError(f"{what} does not state its {option}", remedy=f"Give --{option}")
    return value
