"""Common parts of the experiments' commands: choice, progress and the end."""

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from uavrt.cli.shown.outputs import print_json
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.core.errors import UsageError
from uavrt_experiments.result import Row
from uavrt_experiments.tables import bars_kept, drawn, write_rows


def chosen(only: str | None, known: Iterable[str]) -> tuple[str, ...]:
    """Experiments named by ``--only``, in the order of `known`.

    Raises `UsageError`: one is unknown.
    """
    names = tuple(known)
    asked = names if only is None else [one.strip().upper() for one in only.split(",")]
    if unknown := [one for one in asked if one not in names]:
        raise UsageError(
            f"there is no experiment {', '.join(unknown)}",
            remedy=f"Choose from {', '.join(names)}",
        )
    return tuple(one for one in names if one in asked)


@contextmanager
def part_done(what: str) -> Iterator[Callable[[float, str], None]]:
    """Show a progress bar, or a line at each tenth if the error output is no terminal."""
    if sys.stderr.isatty():
        with progress_bar(what, 1.0) as advance:
            yield lambda part, _what: advance(part)
        return
    shown = 0

    def write(part: float, step: str) -> None:
        nonlocal shown
        if int(10.0 * part) > shown:
            shown = int(10.0 * part)
            print(f"{10 * shown} %, {step}", file=sys.stderr, flush=True)

    yield write


def finish(
    rows: Sequence[Row],
    how: str,
    measured: str,
    output: Path | None,
    *,
    as_json: bool = False,
    stopped: bool = False,
    kept: Path | None = None,
) -> NoReturn:
    """Print and write the table; exit with 1 if a requirement is missed beyond the 95 %
    interval.
    """
    if as_json:
        print_json(rows)
    else:
        print(drawn(rows))
        print(f"{bars_kept(rows)}; {how}")
        print(measured)
    if output is not None:
        write_rows(output, rows)
    if stopped:
        stop_early(kept)
    sys.exit(1 if any(row.contradicted for row in rows) else 0)


def stop_early(kept: Path | None) -> NoReturn:
    """Report after Ctrl-C if the same command continues the run; exit with 130."""
    goes_on = "the rest is lost without --kept" if kept is None else "repeat it to go on"
    print(f"stopped before its end: {goes_on}", file=sys.stderr)
    sys.exit(130)
