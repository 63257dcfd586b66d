"""Count bursts on a channel that no listed code explains (foreign bursts)."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from uavrt.detection.coded.code_judging import Burst
from uavrt.detection.coded.slot_cells import Cells
from uavrt.detection.coded.tuning import FOREIGN


class Foreign:
    """Counts bursts that no listed code explains.

    `span`: length of the longest burst of a listed code [columns].
    """

    def __init__(self, cells: Cells, span: int, guard: int) -> None:
        self._cells, self._span, self._guard = cells, span, guard
        self._count = 0.0
        self._upto = 0
        self._columns = np.zeros(0, np.intp)
        self._rows = np.zeros(0, np.intp)
        self._energies = np.zeros(0, np.float32)

    @property
    def per_hour(self) -> float:
        """Rate of foreign bursts, averaged over the last minutes [1/h]."""
        received_s = min(FOREIGN.memory_s, self._upto * self._cells.column_s) + FOREIGN.start_s
        return FOREIGN.least_per_hour + 3600.0 * self._count / received_s

    def note(self, explained: Sequence[Burst], upto: int) -> None:
        """Find pulses of unknown senders in the recent cells; count bursts before `upto`."""
        cells = self._cells
        loudest = cells.recent.max(axis=0)
        reach = 2 * cells.pulse
        padded = np.pad(loudest, reach)
        top = loudest >= sliding_window_view(padded, 2 * reach + 1).max(axis=1)
        at = np.flatnonzero(top & (loudest >= FOREIGN.weakest_energy))
        columns = at + cells.recent_from
        own = [one.columns for one in explained]
        if own and len(columns):
            apart = np.abs(columns[:, None] - np.concatenate(own))
            at = at[(apart > self._guard).all(axis=1)]
        self._columns, self._rows = at + cells.recent_from, cells.recent[:, at].argmax(axis=0)
        self._energies = loudest[at]
        new = self._columns[(self._columns >= self._upto) & (self._columns < upto)]
        passed_s = (upto - self._upto) * cells.column_s
        self._count *= math.exp(-passed_s / FOREIGN.memory_s)
        self._count += sum(self._of_burst(column) for column in new.tolist()) / 4.0
        self._upto = max(upto, self._upto)

    def _of_burst(self, column: int) -> bool:
        """True if two more signals of equal frequency lie within a burst's length."""
        (row,) = self._rows[self._columns == column]
        near = np.abs(self._columns - column) <= self._span
        return int((near & (np.abs(self._rows - row) <= FOREIGN.rows)).sum()) >= 3

    def about(self, burst: Burst) -> float:
        """Rate of foreign bursts near a burst [1/h]; higher if a foreign burst overlaps it."""
        near = self._columns >= burst.columns[0] - self._span
        near &= self._columns <= burst.columns[-1] + self._span
        near &= np.abs(self._rows - burst.row) <= self._cells.rows_of_a_bin
        near &= self._energies >= max(
            FOREIGN.sure_energy, FOREIGN.beside_share * float(burst.energies.mean())
        )
        apart = np.abs(self._columns[:, None] - burst.columns)
        near &= (apart > self._guard).all(axis=1)
        if not near.any():
            return self.per_hour
        return max(self.per_hour, 3600.0 / (self._span * self._cells.column_s))
