"""Warn when the disk is nearly full, remove old flights if configured, report card faults.

A full disk never stops detection. The recorder retries what it could not write; printed output
of processes is dropped and counted.
"""

import os
import shutil
from pathlib import Path

from uavrt.config.settings import RecordingSettings
from uavrt.core.log import get_logger
from uavrt.core.messages import StatusText
from uavrt.drone.card import NEW_CARD, card_of
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flights_in_order, flown_name, note_flight, with_copies

log = get_logger()


class DiskGuard:
    """Keeps enough disk space free for flights, as set in the recording settings."""

    def __init__(self, directory: Path, settings: RecordingSettings) -> None:
        self._directory = directory
        self._limit_mb = settings.minimum_free_mb
        self._may_prune = settings.remove_oldest_flights
        self._kept = settings.keep_newest_flights
        self._to_note: Path | None = None
        self._note_failed = False
        """True if the failure to add this flight to the list of flights by age is logged."""
        self._flight: Path | None = None
        self._warned = False
        self._card_faults = 0
        """Number of kinds of memory-card faults reported in this flight."""
        self.free_mb: float | None = None
        """Free disk space [MB]; None before the first measurement, or after a failed one."""
        self.faults: tuple[StatusText, ...] = ()
        """Disk and card faults found by the last check, even if reported before."""

    def flying(self, flight: Path | None) -> None:
        """Set the present flight's directory, which is never removed; None without a flight."""
        self._flight = flight
        self._to_note = flight or self._to_note
        if flight is not None:
            self._card_faults, self._note_failed = 0, False

    def check(self) -> list[tuple[int, str]]:
        """Measure free space, remove flights if necessary, check the card. Call it in a thread.

        Returns (severity, text) pairs for the operator.
        """
        self._note()
        self.free_mb = self._measure()
        texts: list[tuple[int, str]] = []
        while self._is_short(self.free_mb) and self._may_prune:
            samples = self._remove_oldest_samples()
            removed = samples or self._remove_oldest()
            if removed is None:
                break
            self.free_mb = self._measure()
            what = "samples of " if samples else ""
            texts.append((4, f"Disk nearly full: removed {what}{removed.name}"))
            self._note()
        nearly_full = f"Disk nearly full: below {self._limit_mb:.0f} MB free. Detection goes on"
        space = [(4, nearly_full)] if self._is_short(self.free_mb) else []
        kinds, card = self._card_fault()
        if not self._warned:
            texts += space
        self._warned = bool(space)
        if kinds > self._card_faults:
            texts += card
        self._card_faults = kinds
        self.faults = tuple(StatusText(severity=s, text=text) for s, text in space + card)
        return texts

    def _note(self) -> None:
        if self._to_note is None:
            return
        try:
            note_flight(self._to_note)
        except OSError as error:
            if not self._note_failed:
                log.warning(
                    "cannot write the list of flights in the order of recording",
                    reason=str(error),
                )
            self._note_failed = True
        else:
            self._to_note = None

    def _card_fault(self) -> tuple[int, list[tuple[int, str]]]:
        """Return the number of card faults and, if there are any, a text with its severity."""
        card = card_of(self._directory)
        faults = card.faults() if card is not None else []
        text = f"Memory card: {', '.join(faults)}. {NEW_CARD}"
        return len(faults), [(3, text)] if faults else []

    def _is_short(self, free_mb: float | None) -> bool:
        return free_mb is not None and free_mb < self._limit_mb

    def _measure(self) -> float | None:
        try:
            usage = os.statvfs(self._directory)
        except OSError:
            return None
        return usage.f_bavail * usage.f_frsize / 1e6

    def _remove_oldest(self) -> Path | None:
        return next((path for path in self._removable_flights() if _removed(path)), None)

    def _remove_oldest_samples(self) -> Path | None:
        for path in self._removable_flights():
            channels = FlightLayout(path).channels_directory
            if channels.is_dir() and not channels.is_symlink() and _removed(channels):
                return path
        return None

    def _removable_flights(self) -> list[Path]:
        """Return the flights that may be removed, oldest first.

        The newest flights, starred ones and the one in progress stay. Copies of a flight are
        removed before the flight itself, because they contain less.
        """
        flights = [path for path in flights_in_order(self._directory) if not path.is_symlink()]
        present = None if self._flight is None else self._flight.name
        return [
            path
            for own in with_copies(flights)[: -self._kept]
            for path in reversed(own)
            if flown_name(path.name) != present and not FlightLayout(path).star.exists()
        ]


def _removed(directory: Path) -> bool:
    try:
        shutil.rmtree(directory)
    except OSError as error:
        log.warning("cannot remove a flight", directory=str(directory), reason=str(error))
        return False
    return True
