"""What an hour of flight asks of a memory card, in bytes and flushes.

The drone side in its processes, with poses and a stand-in radio; bytes are those that each
process gave to the disk (proc(5), ``write_bytes`` of ``io``), flushes the recorder's fsyncs.
"""

from benchmarks.harness import Table
from uavrt_experiments.resources.report import Written
from uavrt_experiments.resources.run import run_written

MINUTES = 10.0
LOADS = (8, 100)
"""Tags; every fourth of them beeps."""
HOURS_A_YEAR = 200.0


def run() -> list[Table]:
    """All tables of this section."""
    return [
        Table(
            title="What an hour of flight writes",
            header=["tags", "all but samples MB", "kept samples MB", "fsyncs", "GB a year"],
            rows=[_row(tags, run_written(tags, MINUTES)) for tags in LOADS],
            notes=[
                f"{MINUTES:g} minutes each. The last 30 s or so of kept samples wait in the "
                "kernel's cache and are not in the figure.",
                f"A year: {HOURS_A_YEAR:g} hours of flight. A 32 GB card that is written 500 "
                "times over takes 16 000 GB.",
            ],
        )
    ]


def _row(tags: int, written: Written) -> list[str]:
    samples = written.mb_h.get("receiver", 0.0)
    rest = written.together_mb_h
    return [
        str(tags),
        f"{rest:.0f}",
        f"{samples:.0f}",
        f"{written.syncs_h:.0f}",
        f"{(rest + samples) * HOURS_A_YEAR / 1e3:.1f}",
    ]
