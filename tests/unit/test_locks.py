"""What the drone installs is pinned by hash, and may be shipped."""

import re
import tomllib
from pathlib import Path
from runpy import run_path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
LOCKS = ROOT / "deploy/locks"
ALL = ("drone.txt", "drone-ros2.txt", "drone-page.txt", "build.txt")
PIN = re.compile(
    r"^([\w.-]+)==(\S+)((?: ;[^\\\n]*)?) \\\n((?:    --hash=\S+(?: \\)?\n)+)", re.M
)


def pins(lock: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for match in PIN.finditer((LOCKS / lock).read_text()):
        found.setdefault(canonicalize_name(match[1]), []).append(match[2])
    return found


def wanted(lock: str) -> list[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    runs: list[str] = project["project"]["dependencies"]
    extras: dict[str, list[str]] = project["project"]["optional-dependencies"]
    all_wanted: dict[str, list[str]] = {
        "drone.txt": runs,
        "drone-ros2.txt": runs + extras["ros2"],
        "drone-page.txt": runs + extras["ground"],
        "build.txt": project["build-system"]["requires"],
    }
    return all_wanted[lock]


@pytest.mark.parametrize("lock", ALL)
def test_a_lock_pins_every_requirement_to_an_allowed_version(lock: str) -> None:
    found, requirements = pins(lock), wanted(lock)
    assert requirements
    for text in requirements:
        requirement = Requirement(text)
        versions = found[canonicalize_name(requirement.name)]
        assert versions
        assert all(requirement.specifier.contains(version) for version in versions), (
            f"{text} is not what {lock} pins ({versions}): run `make locks`"
        )


@pytest.mark.parametrize("lock", ALL)
def test_nothing_in_a_lock_is_without_a_hash_or_from_elsewhere(lock: str) -> None:
    text = (LOCKS / lock).read_text()
    rest = PIN.sub("", text)
    assert pins(lock)
    assert all(line.lstrip().startswith("#") for line in rest.splitlines() if line.strip())
    assert "://" not in text


def test_what_is_installed_together_agrees_on_the_versions() -> None:
    for more in ("drone-page.txt", "drone-ros2.txt"):
        agreed = pins(more)
        assert {name: agreed[name] for name in pins("drone.txt")} == pins("drone.txt")


def test_an_update_brings_what_the_page_of_an_image_needs() -> None:
    maker = run_path(str(ROOT / "deploy/make-update.py"))
    assert pins(maker["LOCK"].name).keys() >= {"numpy", "starlette", "uvicorn", "segno"}
