"""Where samples come from: radio programs, pipes and files behind one interface."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.radio.band_source import BandDatagramSource
    from uavrt.radio.channel_datagram import (
        PortScheme,
        StampStyle,
        channel_port,
        decode_channel_datagram,
        stamp_style,
    )
    from uavrt.radio.channel_output import ChannelOutput
    from uavrt.radio.channel_sender import ChannelDatagramSender
    from uavrt.radio.channel_source import ChannelDatagramSource, FrameOrder
    from uavrt.radio.checking import check_device
    from uavrt.radio.devices import unchosen, usb_radios
    from uavrt.radio.formats import CF32, CI8, CS16, CU8, FORMATS, SampleFormat, sample_format
    from uavrt.radio.joined import JoinedRecording
    from uavrt.radio.losses import most_lost
    from uavrt.radio.opening import open_channel, open_radio, open_recording, open_stream
    from uavrt.radio.placing import HOLD_S, Placer
    from uavrt.radio.program import ProgramSource
    from uavrt.radio.programs import PROGRAMS, receive_command
    from uavrt.radio.recording import Layout, RecordingSource, Segment
    from uavrt.radio.sanity import SampleCheck
    from uavrt.radio.sigmf import sigmf_global, sigmf_layout
    from uavrt.radio.soapy import SoapySource
    from uavrt.radio.source import SampleSource
    from uavrt.radio.stream import StreamSource, block_length
    from uavrt.radio.times import NominalTimes, TimeKeeper
    from uavrt.radio.udp_address import is_udp_address, listen, parse_udp_address

__all__ = [
    "CF32",
    "CI8",
    "CS16",
    "CU8",
    "FORMATS",
    "HOLD_S",
    "PROGRAMS",
    "BandDatagramSource",
    "ChannelDatagramSender",
    "ChannelDatagramSource",
    "ChannelOutput",
    "FrameOrder",
    "JoinedRecording",
    "Layout",
    "NominalTimes",
    "Placer",
    "PortScheme",
    "ProgramSource",
    "RecordingSource",
    "SampleCheck",
    "SampleFormat",
    "SampleSource",
    "Segment",
    "SoapySource",
    "StampStyle",
    "StreamSource",
    "TimeKeeper",
    "block_length",
    "channel_port",
    "check_device",
    "decode_channel_datagram",
    "is_udp_address",
    "listen",
    "most_lost",
    "open_channel",
    "open_radio",
    "open_recording",
    "open_stream",
    "parse_udp_address",
    "receive_command",
    "sample_format",
    "sigmf_global",
    "sigmf_layout",
    "stamp_style",
    "unchosen",
    "usb_radios",
]
__getattr__ = lazily(
    __name__,
    {
        "BandDatagramSource": "band_source",
        "CF32": "formats",
        "CI8": "formats",
        "CS16": "formats",
        "CU8": "formats",
        "ChannelDatagramSender": "channel_sender",
        "ChannelDatagramSource": "channel_source",
        "ChannelOutput": "channel_output",
        "FORMATS": "formats",
        "FrameOrder": "channel_source",
        "HOLD_S": "placing",
        "JoinedRecording": "joined",
        "Layout": "recording",
        "NominalTimes": "times",
        "PROGRAMS": "programs",
        "Placer": "placing",
        "PortScheme": "channel_datagram",
        "ProgramSource": "program",
        "RecordingSource": "recording",
        "SampleCheck": "sanity",
        "SampleFormat": "formats",
        "SampleSource": "source",
        "Segment": "recording",
        "SoapySource": "soapy",
        "StampStyle": "channel_datagram",
        "StreamSource": "stream",
        "TimeKeeper": "times",
        "block_length": "stream",
        "channel_port": "channel_datagram",
        "check_device": "checking",
        "unchosen": "devices",
        "usb_radios": "devices",
        "decode_channel_datagram": "channel_datagram",
        "is_udp_address": "udp_address",
        "listen": "udp_address",
        "most_lost": "losses",
        "open_channel": "opening",
        "open_radio": "opening",
        "open_recording": "opening",
        "open_stream": "opening",
        "parse_udp_address": "udp_address",
        "receive_command": "programs",
        "sample_format": "formats",
        "sigmf_global": "sigmf",
        "sigmf_layout": "sigmf",
        "stamp_style": "channel_datagram",
    },
)
