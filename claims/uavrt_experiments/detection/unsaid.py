"""E9: unreported sample loss in the radio, and its effect on times and pulses."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from uavrt.core.messages import IQBlock
from uavrt.core.units import ns_from_s
from uavrt.radio.sample_stream import block_length
from uavrt.radio.timing.sample_placing import HOLD_S, Placer
from uavrt_experiments.detection.arrivals import DeliveredStream, Delivery
from uavrt_experiments.detection.cases import Case
from uavrt_experiments.detection.signals import START_NS
from uavrt_experiments.detection.trials import (
    RATE_HZ,
    Comparison,
    Flight,
    Samples,
    compare,
    detect_blocks,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import share_by_flight

_TRANSFER_S = 65_536 / 3_000_000
"""Duration of one write of airspy_rx [s]."""
_WITHIN_S = 0.020
_SETTLED_S = 1.0
"""Time after a loss from which every time must be right [s]."""
_EVERY_S = 0.37
_STREAM_S = 120.0
_FLIGHT_S = 180.0
_SHORT_S = 60.0
_ENR_DB = 16.0


def place(stream: DeliveredStream, samples: Samples | None = None) -> Iterator[IQBlock]:
    """Combine arrivals into blocks, as the source of a live stream does.

    `stream`: the arrivals. `samples` (stream.samples,): samples that arrived; zeros without
    memory if only times matter.
    """
    rate_hz = stream.delivery.sample_rate_hz
    came = np.broadcast_to(np.complex64(0), stream.samples) if samples is None else samples
    placer = Placer(rate_hz)
    placer.begin(START_NS)
    wanted, hold = block_length(rate_hz), round(HOLD_S * rate_hz)
    first = held = 0
    for transfer in stream.transfers():
        now_ns = START_NS + ns_from_s(transfer.arrival_s)
        left = transfer.count
        while left:
            full = held >= wanted and placer.settle()
            room = wanted - held if held < wanted or full else wanted + hold - held
            part = min(left, max(room, 1))
            held, left = held + part, left - part
            placer.arrived(held + left, now_ns)
            while placer.cut or (held >= wanted and (placer.settle() or held >= wanted + hold)):
                count = placer.cut or held
                yield placer.place(came[first : first + count])
                first, held = first + count, held - count


@dataclass(frozen=True, slots=True, kw_only=True)
class TimesKept:
    """Accuracy of a stream's times."""

    instants: int
    within: int
    settled: int
    """Number of instants at least a second after the last loss."""
    settled_within: int
    lost: int
    found: int
    unsure: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Unsaid:
    """A radio with unreported losses, whose arrivals are also delayed for other reasons."""

    delivery: Delivery

    def keep_times(self, rng: np.random.Generator, index: int) -> TimesKept:
        """Compare the times of a stream of arrivals with the true ones."""
        ppm = (50.0, -50.0, 0.0)[index % 3]
        stream = DeliveredStream(replace(self.delivery, rate_error_ppm=ppm), _STREAM_S, rng)
        step = round(_EVERY_S * stream.delivery.sample_rate_hz)
        within = settled = settled_within = instants = found = unsure = first = 0
        due = step
        for block in place(stream):
            found += block.lost_before
            unsure += block.unsure_before
            while due < first + len(block.samples):
                at_s = (block.time_ns - START_NS) * 1e-9 + (due - first) / block.sample_rate_hz
                good = abs(at_s - stream.true_s(due)) <= _WITHIN_S
                far = stream.since_loss_s(due) >= _SETTLED_S
                instants, within = instants + 1, within + good
                settled, settled_within = settled + far, settled_within + (far and good)
                due += step
            first += len(block.samples)
        return TimesKept(
            instants=instants,
            within=within,
            settled=settled,
            settled_within=settled_within,
            lost=stream.lost,
            found=found,
            unsure=unsure,
        )

    def fly(
        self, rng: np.random.Generator, _index: int, *, duration_s: float = _FLIGHT_S
    ) -> tuple[Comparison, Comparison]:
        """Compare pulses found with unreported losses and with exactly reported ones."""
        flight = Flight(enr_db=_ENR_DB, duration_s=duration_s)
        samples, truth = flight.samples(rng)
        delivery = replace(self.delivery, sample_rate_hz=RATE_HZ)
        stream = DeliveredStream(delivery, duration_s, rng)
        places = np.arange(stream.samples)
        true = np.rint(
            places + stream.gap * np.searchsorted(stream.losses, places, side="right")
        ).astype(np.int64)
        came = np.ascontiguousarray(samples[true])
        unsaid, _ = detect_blocks(
            (
                _filled(b.samples, b.time_ns, b.lost_before, b.sample_rate_hz)
                for b in place(stream, came)
            ),
            flight.tag,
        )
        reported, _ = detect_blocks(_with_true_times(stream, came), flight.tag)
        there = [
            pulse for pulse in truth if _came(true, pulse.start_s, flight.tag.pulse_width_s)
        ]
        return compare(unsaid, there, flight.tag), compare(reported, there, flight.tag)


def _filled(
    samples: Samples, time_ns: int, lost: int, sample_rate_hz: float
) -> tuple[Samples, int]:
    """Replace reported losses by zeros, as the front end does before any detector."""
    if not lost:
        return samples, time_ns
    zeros = np.zeros(lost, np.complex64)
    return np.concatenate((zeros, samples)), time_ns - ns_from_s(lost / sample_rate_hz)


def _with_true_times(stream: DeliveredStream, came: Samples) -> Iterator[tuple[Samples, int]]:
    """Blocks that end at losses, with their true times."""
    size = block_length(stream.delivery.sample_rate_hz)
    edges = [0, *stream.losses.tolist(), stream.samples]
    for begin, end in pairwise(edges):
        for first in range(begin, end, size):
            lost = stream.gap if first == begin and begin else 0
            time_ns = START_NS + ns_from_s(stream.true_s(first))
            some = came[first : min(first + size, end)]
            yield _filled(some, time_ns, lost, stream.true_rate_hz)


def _came(
    true: "np.ndarray[tuple[int], np.dtype[np.int64]]", start_s: float, width_s: float
) -> bool:
    low, high = np.searchsorted(true, [start_s * RATE_HZ, (start_s + width_s) * RATE_HZ])
    return bool(high - low >= 0.5 * width_s * RATE_HZ)


def _time_rows(case: str, kept: Sequence[TimesKept], share: float) -> list[Row]:
    def row(quantity: str, good: list[int], all_: list[int], least: float) -> Row:
        return Row.with_interval(
            "E9",
            quantity,
            case,
            share_by_flight(good, all_),
            sum(all_),
            least=least,
            note=f"{len(kept)} streams of {_STREAM_S:g} s",
        )

    rows = [
        row("times within 20 ms", [k.within for k in kept], [k.instants for k in kept], 0.95)
    ]
    if sum(k.settled for k in kept) >= 30:
        rows.append(
            row(
                "times within 20 ms from 1 s after each loss",
                [k.settled_within for k in kept],
                [k.settled for k in kept],
                0.99,
            )
        )
    lost = sum(k.lost for k in kept)
    named = [k.found - k.unsure for k in kept]
    if not share:
        rows.append(_count("samples reported lost, while none is", case, sum(named), len(kept)))
    elif share > 0.001:
        ratios = [n / k.lost for n, k in zip(named, kept, strict=True) if k.lost]
        error = 2.0 * float(np.std(ratios)) / math.sqrt(max(len(ratios), 1))
        rows.append(
            Row.with_interval(
                "E9",
                "samples reported lost over those lost",
                case,
                (sum(named) / lost, sum(named) / lost - error, sum(named) / lost + error),
                len(kept),
                least=0.9,
                most=1.1,
            )
        )
    return rows


def _count(quantity: str, case: str, count: int, streams: int) -> Row:
    return Row.with_interval(
        "E9", quantity, case, (float(count), float(count), float(count)), streams, most=0.0
    )


def _recall_rows(case: str, flights: Sequence[tuple[Comparison, Comparison]]) -> list[Row]:
    unsaid, low, high = share_by_flight(
        [u.confirmed for u, _ in flights], [u.true for u, _ in flights]
    )
    reported = sum(t.confirmed for _, t in flights) / sum(t.true for _, t in flights)
    return [
        Row.with_interval(
            "E9",
            "recall over that with reported losses",
            case,
            (unsaid / reported, low / reported, high / reported),
            sum(u.true for u, _ in flights),
            least=0.95,
            note=f"reported {reported:.3f}; {len(flights)} flights",
        )
    ]


def _delivery(share: float, loss_s: float) -> Delivery:
    return Delivery(
        transfer_s=_TRANSFER_S,
        loss_share=share,
        loss_s=loss_s,
        jitter_s=0.002,
        stall_share=0.01,
    )


def _times_case(share: float, loss_s: float) -> Case:
    name = _name(share, loss_s)
    full = Case(
        name=f"times, {name}",
        trials=12,
        least=3,
        seconds=0.15,
        trial=Unsaid(delivery=_delivery(share, loss_s)).keep_times,
        rows=lambda kept: _time_rows(name, kept, share),
    )
    return replace(full, short=replace(full, least=2))


def _recall_case(share: float, loss_s: float) -> Case:
    name = _name(share, loss_s)
    fly = Unsaid(delivery=_delivery(share, loss_s)).fly
    full = Case(
        name=f"recall, {name}",
        trials=12,
        least=3,
        seconds=1.0,
        trial=fly,
        rows=lambda flights: _recall_rows(f"{_ENR_DB:g} dB, {name}", flights),
    )
    return replace(full, short=replace(full, least=1, trial=partial(fly, duration_s=_SHORT_S)))


def _name(share: float, loss_s: float) -> str:
    if not share:
        return "nothing lost"
    return f"{100.0 * share:g} % lost unsaid, {1e3 * loss_s:g} ms each"


UNSAID_CASES: tuple[Case, ...] = (
    _times_case(0.0, 0.005),
    *(_times_case(0.002, loss_s) for loss_s in (0.001, 0.005, 0.1)),
    *(_times_case(0.01, loss_s) for loss_s in (0.001, 0.005, 0.02, 0.1)),
    *(_times_case(0.05, loss_s) for loss_s in (0.001, 0.005, 0.02, 0.05, 0.1)),
    *(_recall_case(0.01, loss_s) for loss_s in (0.005,)),
    *(_recall_case(0.05, loss_s) for loss_s in (0.001, 0.005, 0.02, 0.1)),
)
