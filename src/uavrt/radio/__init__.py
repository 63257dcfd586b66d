"""Where samples come from: radio programs, pipes and files behind one interface."""

from uavrt.radio.band_source import BandDatagramSource
from uavrt.radio.channel_sender import ChannelDatagramSender
from uavrt.radio.channel_source import ChannelDatagramSource
from uavrt.radio.formats import CF32, CI8, CS16, CU8, FORMATS, SampleFormat, sample_format
from uavrt.radio.opening import open_channel, open_radio, open_recording, open_stream
from uavrt.radio.program import ProgramSource, check_device
from uavrt.radio.programs import PROGRAMS, receive_command
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
    "BandDatagramSource",
    "ChannelDatagramSender",
    "ChannelDatagramSource",
    "Layout",
    "NominalTimes",
    "ProgramSource",
    "RecordingSource",
    "SampleFormat",
    "SampleSource",
    "Segment",
    "SoapySource",
    "StreamSource",
    "TimeKeeper",
    "check_device",
    "open_channel",
    "open_radio",
    "open_recording",
    "open_stream",
    "receive_command",
    "sample_format",
]
