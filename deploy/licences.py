"""List the licences of everything that is installed with uavrt, as it stands in deploy/locks.

    python deploy/licences.py [--check]

prints a table (name, version, licence) of all distributions of the lock files that are
installed here; with ``--check`` it ends with 1 when one is under the GPL or AGPL, or names no
licence at all. The build's own tools are listed apart: they do not run on the drone.
"""

import re
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

LOCKS = Path(__file__).parent / "locks"
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)", re.MULTILINE)
_FORBIDDEN = re.compile(
    r"(?<!L)(?<!Lesser )\bA?GPL|GNU (Affero )?General Public", re.IGNORECASE
)


def pinned(lock: str) -> list[str]:
    """Get the names of a lock file's distributions."""
    text = (LOCKS / f"{lock}.txt").read_text()
    return sorted({match[1] for match in _PIN.finditer(text)})


def licence(found: Distribution) -> str:
    """Get what a distribution says of its licence (Core metadata specifications, 2.4)."""
    metadata = found.metadata
    if expression := metadata.get("License-Expression"):
        return expression
    classified = [
        entry.rpartition(" :: ")[2]
        for entry in metadata.get_all("Classifier") or []
        if entry.startswith("License ::") and not entry.endswith("OSI Approved")
    ]
    if classified:
        return ", ".join(classified)
    return (metadata.get("License") or "").strip().split("\n")[0]


def main() -> int:
    """Print the table; 1 if a licence is missing or forbidden, and that is checked."""
    faults = []
    runs = pinned("drone-ros2")
    for title, names in (("runs with uavrt", runs), ("builds it", pinned("build"))):
        print(f"\n{title}\n")
        for name in names:
            try:
                found = distribution(name)
            except PackageNotFoundError:
                print(f"{name:24} not installed here")
                continue
            said = licence(found)
            print(f"{name:24} {found.version:14} {said or 'no licence named'}")
            if not said or (names is runs and _FORBIDDEN.search(said)):
                faults.append(f"{name}: {said or 'no licence named'}")
    if "--check" in sys.argv[1:] and faults:
        print("\nnot to be shipped:", *faults, sep="\n  ", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
