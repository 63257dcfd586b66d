"""Send the operator's commands to the drone, one at a time, and report progress; each returns a
text for the operator, or raises an error of the drone or the link.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

from uavrt.config.tags.tag_corrections import TagCorrection, correction_of
from uavrt.config.tags.tag_files import faults_of_tags
from uavrt.core.commands import Button, CommandName, SystemState
from uavrt.core.errors import FormatError, LinkError, RecordingError, UavrtError
from uavrt.core.units import counted
from uavrt.flight.reading.noted_places import Mark, mark_note
from uavrt.ground.link.button_states import (
    ACTIONS,
    BUTTONS,
    COMMAND_OF_ACTION,
    Busy,
    action_states,
    cannot_command,
    unreachable,
    wait_for,
)
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.page_values import number_in, places_in
from uavrt.ground.link.served_vehicle import ServedVehicle

_SWITCHED_OFF_S: Final = 300.0
"""Time without contact after which the drone is assumed to be switched off [s]. A flying drone
would have returned by its failsafe before."""


def _parameter(body: dict[str, Any]) -> tuple[str, float]:
    """Read a parameter's name and value; raises `FormatError`."""
    name = body.get("name")
    if not isinstance(name, str) or not name.isascii() or not 0 < len(name) <= 16:
        raise FormatError("name must be the name of a parameter")
    return name, number_in(body, "value")


def _correction(vehicle: ServedVehicle, request: dict[str, Any]) -> TagCorrection:
    """Read the requested correction of a tag, or its undoing; raises `FormatError`."""
    now_ns = vehicle.clock.now_ns()
    tag_id = request.get("tag_id")
    tag = next((one for one in vehicle.store.tags if one.tag_id == tag_id), None)
    if tag is None:
        raise FormatError("tag_id must be the number of a listed tag")
    if request.get("undo") is True:
        last = next((x for x in vehicle.store.corrections_listed if x.tag_id == tag_id), None)
        if last is None:
            raise FormatError(f"tag {tag_id} has no correction to undo")
        return last.undone(tag, now_ns)
    frequency_hz = number_in(request, "frequency_hz")
    for beep in vehicle.drone.beeps:
        if tag.tag_id in beep.tag_ids and abs(beep.frequency_hz - frequency_hz) < 1.0:
            correction = correction_of(tag, beep, now_ns, vehicle.drone.beeps)
            if correction is not None:
                return correction
    raise FormatError(f"no signal measured at {frequency_hz:.0f} Hz can correct tag {tag_id}")


def _gain_in_words(correction: TagCorrection) -> str:
    from uavrt.detection.sensitivity import gain_in_words  # loads scipy.stats: 0.4 s

    return gain_in_words(correction.before, correction.after)


def _place(body: dict[str, Any]) -> tuple[float, float] | None:
    """Read the position of a mark; None if the request has none. Raises `FormatError`."""
    if "latitude_deg" not in body:
        return None
    (place,) = places_in([[body["latitude_deg"], body.get("longitude_deg")]])
    return place


class Commands:
    """Sends the operator's commands to one vehicle."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._vehicle = vehicle

    def by_name(self, body: dict[str, Any]) -> dict[str, Callable[[], Awaitable[str]]]:
        """Functions that send the page's commands, by the button's action."""
        return {
            "send_tags": self.send_tags,
            "start": self.start,
            "stop": self.stop,
            "capture": self.capture,
            "mark": lambda: self.mark(str(body.get("text", "")), _place(body)),
            **{one.action: partial(self.ask, one, body) for one in BUTTONS if one.asking},
            "set_parameter": lambda: self.set_parameter(body),
            "correct_tag": lambda: self.correct_tag(body),
        }

    async def send_tags(self) -> str:
        """Send the tag table to the drone; return a text for the operator."""
        return await self.send_tags_by(self._allowed("send_tags"))

    async def send_tags_by(self, link: GroundLink) -> str:
        """Send the tag table over `link` without regard to the drone's last reported state."""
        tags = self._vehicle.store.chosen_tags
        async with self._working("send_tags", f"sending {counted(len(tags), 'tag')}"):
            await link.upload_tags(tags, self._progress)
            self._vehicle.drone.tags_accepted(tags)
            return f"{len(tags)} {'tag' if len(tags) == 1 else 'tags'} sent"

    async def start(self) -> str:
        """Start detection on the drone and the recording of a flight on the ground."""
        return await self.start_by(self._allowed("start"))

    async def start_by(self, link: GroundLink) -> str:
        """Start detection over `link` without regard to the drone's last reported state."""
        async with self._working("start", "starting"):
            directory = await self._use_radio(link, "start_detection")
            self._vehicle.drone.started(directory)
            if self._vehicle.flight.keeper.ended:
                self._vehicle.begin_flight()
            return directory or "detecting"

    async def stop(self) -> str:
        """Stop detection or capture without regard to the drone's last reported state."""
        if (reason := unreachable(self._vehicle.situation())) is not None:
            raise LinkError(reason)
        link = self._vehicle.connection.link
        assert link is not None
        async with self._working("stop", "stopping"):
            await link.stop_detection()
            return "stopped"

    async def capture(self) -> str:
        """Start to record raw samples on the drone."""
        link = self._allowed("capture")
        async with self._working("capture", "starting a raw capture"):
            return await self._use_radio(link, "raw_capture") or "capturing"

    async def _use_radio(self, link: GroundLink, name: CommandName) -> str:
        """Start detection or a raw capture with the radio settings of the page; return the
        flight's directory.
        """
        settings = self._vehicle.store.settings
        frequency = settings.center_frequency_mhz
        return await link.start_detection(
            center_frequency_hz=None if frequency is None else frequency * 1e6,
            gain=settings.gain or 0,
            name=name,
        )

    async def ask(self, button: Button, body: dict[str, Any]) -> str:
        """Send a maintenance command; `body` holds a number for each of its fields."""
        row = COMMAND_OF_ACTION[button.action]
        values = {one.name: number_in(body, one.name) for one in row.fields}
        if fault := row.fault([*values.values()]):
            raise FormatError(fault)
        link = self._allowed(button.action)
        async with self._working(button.action, button.asking):
            return await link.ask(row.name, values) or button.done

    async def correct_tag(self, request: dict[str, Any]) -> str:
        """Correct a listed tag by a measurement, first on the drone and then in the list.

        ``{"tag_id": …, "frequency_hz": …}`` identifies the measured signal by its frequency;
        ``"undo": true`` restores the values before the last correction. If the drone refuses or
        does not answer, the list stays unchanged.
        """
        vehicle, drone, store = self._vehicle, self._vehicle.drone, self._vehicle.store
        correction = _correction(vehicle, request)
        tag_id = correction.tag_id
        if faults := faults_of_tags([correction.after]):
            raise FormatError(faults[0])
        sent = {tag.tag_id: tag for tag in drone.sent_tags}
        link = self._link_to_correct(searched=tag_id in sent or not sent)
        async with self._working("correct_tag", f"correcting tag {tag_id}"):
            if link is not None:
                after = correction.applied(sent.get(tag_id, correction.before))
                await link.correct_tag(after)
                drone.set_tags(tuple((sent and sent | {tag_id: after}).values()))
                vehicle.flight.keeper.write(after)
            try:
                await store.disk.run(store.correct_tag, correction)
            except (OSError, UavrtError) as error:
                reason = error.message if isinstance(error, UavrtError) else error
                text = f"tag {tag_id} was not corrected in this station's tag list: {reason}"
                if link is not None:
                    text = (
                        f"tag {tag_id} was corrected on the drone, but not in this station's "
                        f"tag list: {reason}"
                    )
                raise RecordingError(
                    text,
                    remedy="Check that the tag is listed and the disk has space, then repeat "
                    "the correction",
                ) from error
        drone.beeps[:] = [one for one in drone.beeps if tag_id not in one.tag_ids]
        vehicle.show_tags()
        text = str(correction)
        if link is None and drone.state is None and not vehicle.flight.keeper.ended:
            text += (
                ". Only the list was corrected: send the tags when the drone is back in contact"
            )
        vehicle.feed.note(5, text)
        return f"{text}{await asyncio.to_thread(_gain_in_words, correction)}"

    def _link_to_correct(self, *, searched: bool) -> GroundLink | None:
        """Link to the detecting drone if the tag is `searched`; None: correct the list only."""
        vehicle, now = self._vehicle, self._vehicle.situation()
        lost = now.state is None and not vehicle.flight.keeper.ended
        lost = lost and (now.drone_present or now.silent_s < _SWITCHED_OFF_S)
        in_flight = searched and (now.state is SystemState.DETECTING or lost)
        reason = cannot_command(now) if in_flight else wait_for(now)
        if reason is not None and lost and not now.drone_present:
            minutes = f"{_SWITCHED_OFF_S / 60:.0f} min"
            reason += (
                f". After {minutes} without contact, this station's tag list can be corrected"
            )
        if reason is not None:
            raise LinkError(reason)
        return vehicle.connection.link if in_flight else None

    async def parameters(self) -> dict[str, float]:
        """Request the drone's parameters; return the values by name."""
        return await self._allowed("parameters").parameters.list_all()

    async def set_parameter(self, body: dict[str, Any]) -> str:
        """Set a parameter of the drone: ``{"name": …, "value": …}``."""
        name, value = _parameter(body)
        link = self._allowed("parameters")
        async with self._working("parameters", f"setting {name}"):
            value = await link.parameters.set(name, value)
            if name == "RADIO_PPM":  # what was measured before is no longer so
                self._vehicle.drone.beeps.clear()
            return f"{name} = {value:g}"

    async def mark(self, text: str = "", place: tuple[float, float] | None = None) -> str:
        """Record a remark with time and position; by default the drone's position."""
        now_ns = self._vehicle.clock.now_ns()
        pose = self._vehicle.connection.watch.pose if self._vehicle.connection.watch else None
        if place is None and pose is not None:
            place = (pose.latitude_deg, pose.longitude_deg)
        if place is None:
            note = "mark" + (f": {text.strip()[:200]}" if text.strip() else "")
        else:
            note = mark_note(*place, text)
            self._vehicle.flight.marks.append(
                Mark(
                    time_ns=now_ns,
                    latitude_deg=place[0],
                    longitude_deg=place[1],
                    text=text.strip()[:200],
                )
            )
            self._vehicle.feed.send_state()
        self._vehicle.flight.keeper.add_note(note, now_ns)
        self._vehicle.flight.commit_soon()
        self._vehicle.feed.note(6, note)
        return note

    def _allowed(self, action: str) -> GroundLink:
        """Return the link if the action is enabled now; raises `CommandRefused` if not."""
        state = action_states(self._vehicle.situation())[action]
        if not state["enabled"]:
            raise LinkError(str(state["reason"]))
        assert self._vehicle.connection.link is not None
        return self._vehicle.connection.link

    @contextlib.asynccontextmanager
    async def _working(self, action: str, text: str) -> AsyncIterator[None]:
        self._vehicle.set_busy(Busy(action=action, text=text))
        try:
            yield
        except UavrtError as error:
            self._vehicle.feed.note(4, f"{ACTIONS.get(action, 'Correction')} failed: {error}")
            raise
        finally:
            self._vehicle.set_busy(None)

    def _progress(self, done: int, whole: int) -> None:
        if (busy := self._vehicle.busy) is not None:
            self._vehicle.set_busy(replace(busy, done=done, whole=whole))
