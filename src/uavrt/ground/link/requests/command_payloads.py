"""Encode the ground's commands in the protocol version of the drone."""

import random
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from uavrt.config.parameters import check_start
from uavrt.core.commands import COMMANDS, CommandId, CommandName, Generation
from uavrt.core.errors import LinkError
from uavrt.core.messages import Tag
from uavrt.link.tunnel.generations.g0 import HeaderMessage
from uavrt.link.tunnel.generations.g1 import FieldsG1, TagG1
from uavrt.link.tunnel.generations.g2 import BareG2, FieldsG2, TagG2, UploadG2
from uavrt.link.tunnel.own_messages.coded_tag import CodedTag
from uavrt.link.tunnel.tunnel_records import tag_to_wire

NUMBERED_FROM = 2**31


class CommandEncoder:
    """Encodes commands for one protocol version; in G2 each has a request id, never 0."""

    def __init__(self, generation: Generation) -> None:
        self._generation: Generation = generation
        # From anywhere: a restarted ground station must not reuse the last one's ids.
        self._last_id = random.randrange(1, NUMBERED_FROM)

    def upload(self, tags: Sequence[Tag]) -> list[bytes]:
        """Encode the messages of a tag upload, in order: begin, each tag, end; raises
        `LinkError` if impossible. A coded tag's message has type `CODED_TAG_TYPE`, all others
        type 0.
        """
        coded = [tag.tag_id for tag in tags if tag.coded]
        if coded and self._generation == "G0":
            raise LinkError(
                f"the original UAV-RT cannot search for coded tags (tags {coded})",
                remedy="Send only the tags without codes, or choose another drone software "
                "under Set-up",
            )
        if self._generation != "G2":
            older: Generation = "G0" if self._generation == "G0" else "G1"
            return [
                HeaderMessage(command=CommandId.START_TAGS).encode(),
                *(
                    (CodedTag(tag=tag) if tag.coded else tag_to_wire(tag, older)).encode()
                    for tag in tags
                ),
                HeaderMessage(command=CommandId.END_TAGS).encode(),
            ]
        upload_id = self._next_id()
        frames = [
            UploadG2(
                command=command,
                request_id=self._next_id(),
                upload_id=upload_id,
                tag_count=len(tags),
            ).encode()
            for command in (CommandId.START_TAGS, CommandId.END_TAGS)
        ]
        inside = []
        for index, tag in enumerate(tags):
            numbers = {
                "request_id": self._next_id(),
                "upload_id": upload_id,
                "tag_index": index,
            }
            if tag.coded:
                inside.append(CodedTag(tag=tag, **numbers).encode())
                continue
            wire = tag_to_wire(tag, "G1")
            assert isinstance(wire, TagG1)
            inside.append(TagG2(tag=wire, **numbers).encode())
        return [frames[0], *inside, frames[1]]

    def correction(self, tag: Tag) -> bytes:
        """Encode the correction of one beeping tag, with its measured values."""
        if self._generation != "G2":
            return tag_to_wire(tag, "G0" if self._generation == "G0" else "G1").encode()
        wire = tag_to_wire(tag, "G1")
        assert isinstance(wire, TagG1)
        numbers = {"request_id": self._next_id(), "upload_id": 0, "tag_index": 0}
        return TagG2(tag=wire, **numbers).encode()

    def start(
        self,
        center_frequency_hz: float | None,
        gain: int,
        name: CommandName = "start_detection",
    ) -> bytes:
        """Encode the start of detection or of a raw capture; None: chosen by the drone."""
        check_start(None, center_frequency_hz, gain)
        return self.command(
            name, {"center_frequency_hz": center_frequency_hz, "gain": float(gain)}
        )

    def command(
        self, name: CommandName, values: Mapping[str, float | None] = MappingProxyType({})
    ) -> bytes:
        """Encode a command with the given `values`; fields without a value are 0."""
        number, bare = self._check_known(name), not COMMANDS[name].fields
        if self._generation == "G2":
            numbered = {"request_id": self._next_id()}
            if bare:
                return BareG2(command=number, **numbered).encode()
            return FieldsG2.of(number, values, **numbered).encode()
        if bare or self._generation == "G0":  # which has no fields
            return HeaderMessage(command=number).encode()
        return FieldsG1.of(number, values).encode()

    def _check_known(self, name: CommandName) -> CommandId:
        """Return a command's number in the drone's protocol version; `LinkError` if it has
        none.
        """
        row = COMMANDS[name]
        generation = "G1" if self._generation == "G2v1" else self._generation
        if row.number is None or generation not in row.lengths:
            raise LinkError(
                f"the drone's software has no command {name.replace('_', ' ')}",
                remedy="Under Set-up, choose the software that runs on the drone, or update "
                "the drone",
            )
        return row.number

    def request_id_of(self, payload: bytes) -> int:
        """Read the request id of a payload; 0 before G2."""
        return int.from_bytes(payload[4:8], "little") if self._generation == "G2" else 0

    def _next_id(self) -> int:
        self._last_id = self._last_id % (2**32 - 1) + 1
        return self._last_id
