"""Run benches and write ``benchmarks/results.md``."""

import argparse
import importlib
import pkgutil
from pathlib import Path

import benchmarks
from benchmarks.harness import merge_section, render_section

RESULTS = Path(__file__).parent / "results.md"


def main() -> None:
    """Run the sections named on the command line, or all of them."""
    known = sorted(
        module.name.removeprefix("bench_")
        for module in pkgutil.iter_modules(benchmarks.__path__)
        if module.name.startswith("bench_")
    )
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(known))
    chosen = parser.parse_args().sections or known
    unknown = sorted(set(chosen) - set(known))
    if unknown:
        parser.error(f"no section {', '.join(unknown)}; there are {', '.join(known)}")
    for section in chosen:
        tables = importlib.import_module(f"benchmarks.bench_{section}").run()
        text = render_section(section, tables)
        print(text)
        old = RESULTS.read_text(encoding="utf-8") if RESULTS.exists() else ""
        RESULTS.write_text(merge_section(old, section, text), encoding="utf-8")


if __name__ == "__main__":
    main()
