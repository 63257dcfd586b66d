"""Where samples come from: radio programs, pipes and files behind one interface."""

from uavrt.radio.formats import CF32, CI8, CS16, CU8, FORMATS, SampleFormat, sample_format
from uavrt.radio.opening import open_radio, open_recording, open_stream
from uavrt.radio.program import ProgramSource, check_device
from uavrt.radio.programs import PROGRAMS, RadioProgram, receive_command
from uavrt.radio.recording import Layout, RecordingSource, Segment
from uavrt.radio.soapy import SoapySource
from uavrt.radio.source import SampleSource
from uavrt.radio.stream import StreamSource
from uavrt.radio.times import NominalTimes, TimeKeeper

__all__ = [
    "CF32",
    "CI8",
    "CS16",
    "CU8",
    "FORMATS",
    "PROGRAMS",
    "Layout",
    "NominalTimes",
    "ProgramSource",
    "RadioProgram",
    "RecordingSource",
    "SampleFormat",
    "SampleSource",
    "Segment",
    "SoapySource",
    "StreamSource",
    "TimeKeeper",
    "check_device",
    "open_radio",
    "open_recording",
    "open_stream",
    "receive_command",
    "sample_format",
]
