"""Bytes against an independent implementation."""

import contextlib
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from uavrt.core.errors import FormatError
from uavrt.link.ros2.types import ros_messages as messages
from uavrt.link.ros2.types.cdr import decode, encode
from uavrt.link.ros2.types.interface import Field, definition, fields_of, full_name
from uavrt.link.ros2.types.ros_messages import RosMessage

KINDS = (
    messages.RosPulse,
    messages.RosPulsePose,
    messages.RosTag,
    messages.PoseStamped,
    messages.DiagnosticArray,
    messages.Flag,
    messages.Log,
    messages.graph_messages(16)[2],
)

TYPES = get_typestore(Stores.ROS2_JAZZY)
for kind in KINDS[:3]:
    TYPES.register(get_types_from_msg(definition(kind), full_name(kind)))

NUMBERS: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "byte": st.integers(0, 127),  # rosbags writes no others
    "uint8": st.integers(0, 255),
    "uint16": st.integers(0, 2**16 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "float64": st.floats(allow_nan=False),
    "string": st.text(
        st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20
    ),
    "string<=256": st.text("abc/", max_size=20),
}


def some(kind: type[RosMessage]) -> st.SearchStrategy[Any]:
    return st.builds(kind, **{entry.name: value_of(entry) for entry in fields_of(kind)})


def value_of(entry: Field) -> st.SearchStrategy[Any]:
    if entry.message is not None:
        one = some(entry.message)
        return st.lists(one, max_size=3).map(tuple) if entry.sequence else one
    if entry.length is not None:
        return st.binary(min_size=entry.length, max_size=entry.length)
    return NUMBERS[entry.primitive]


def foreign(message: Any) -> Any:
    """The same message as `rosbags` has it."""
    if isinstance(message, RosMessage):
        names = [entry.name for entry in fields_of(type(message))]
        return TYPES.types[full_name(type(message))](
            *(foreign(getattr(message, name)) for name in names)
        )
    if isinstance(message, tuple):
        return [foreign(item) for item in message]
    if isinstance(message, bytes):
        import numpy as np

        return np.frombuffer(message, np.uint8)
    return message


any_message = st.sampled_from(KINDS).flatmap(some)


@settings(max_examples=60)
@given(any_message)
def test_a_message_has_the_bytes_that_an_independent_writer_gives_it(
    message: RosMessage,
) -> None:
    theirs = TYPES.serialize_cdr(foreign(message), full_name(type(message)))
    assert encode(message) == bytes(theirs)


@settings(max_examples=60)
@given(any_message, st.booleans())
def test_a_message_of_an_independent_writer_is_read_in_either_byte_order(
    message: RosMessage, little_endian: bool
) -> None:
    name = full_name(type(message))
    theirs = TYPES.serialize_cdr(foreign(message), name, little_endian=little_endian)
    assert decode(type(message), bytes(theirs)) == message


@settings(max_examples=60)
@given(
    st.sampled_from(KINDS), st.binary(max_size=200), st.sampled_from([b"", b"\0\0", b"\0\1"])
)
def test_bytes_from_anybody_are_a_message_or_are_refused(
    kind: type[RosMessage], data: bytes, beginning: bytes
) -> None:
    # Anything but a message or this error fails the test.
    with contextlib.suppress(FormatError):
        assert isinstance(decode(kind, beginning + data), kind)


@settings(max_examples=60)
@given(any_message, st.data())
def test_a_message_that_is_cut_short_is_refused_or_lacks_only_padding(
    message: RosMessage, data: st.DataObject
) -> None:
    whole = encode(message)
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    with pytest.raises(FormatError):
        decode(type(message), cut)


def test_a_length_that_cannot_be_is_not_believed() -> None:
    with pytest.raises(FormatError, match="4294967295"):
        decode(messages.DiagnosticArray, b"\0\1\0\0" + bytes(8) + b"\xff\xff\xff\xff")


def test_a_number_that_does_not_fit_is_refused_by_the_message_s_name() -> None:
    with pytest.raises(FormatError, match="uavrt_interfaces/Tag"):
        encode(messages.RosTag(tag_id=-1))


def test_an_unknown_number_stays_unknown() -> None:
    point = decode(messages.Point, encode(messages.Point(x=math.nan)))
    assert math.isnan(point.x)
