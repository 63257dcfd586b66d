"""Errors name what is missing and what to do."""

import errno
import os
import sys
from pathlib import Path

import pytest

from uavrt.analysis.report.style import styled
from uavrt.core.errors import RecordingError, UsageError, needs_extra, os_errors_as
from uavrt.formats.tracks.ulog import read_ulog


@pytest.mark.parametrize(
    ("package", "use"), [("pyulog", lambda: read_ulog(Path("log.ulg"))), ("matplotlib", styled)]
)
def test_a_package_that_is_not_installed_is_named_with_the_command_that_installs_it(
    package: str, use: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert callable(use)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UsageError, match=rf"{package}.*pip install 'uavrt\[analysis\]'"):
        use()


def test_what_works_without_the_extra_is_offered() -> None:
    with (
        pytest.raises(UsageError, match=r"'uavrt\[ground\]', or run without a page"),
        needs_extra("ground", "the page", otherwise=", or run without a page"),
    ):
        import no_such_package  # type: ignore[import-not-found]  # noqa: F401


def test_other_errors_pass() -> None:
    with pytest.raises(ValueError, match="none"), needs_extra("analysis", "a report"):
        raise ValueError("none")


@pytest.mark.parametrize(
    ("said", "read"),
    [("no such tag", "no such tag. Name one"), ("did you mean 3?", "did you mean 3? Name one")],
)
def test_a_remedy_follows_as_a_sentence_of_its_own(said: str, read: str) -> None:
    assert str(UsageError(said, remedy="Name one")) == read


def test_an_error_of_the_system_becomes_ours_with_its_reason() -> None:
    with (
        pytest.raises(RecordingError, match=r"^cannot write it: No space.*\. Make room$"),
        os_errors_as(RecordingError, "cannot write it", remedy="Make room"),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with (
        pytest.raises(UsageError, match=r"^cannot read it: only text\.?$"),
        os_errors_as(UsageError, "cannot read it"),
    ):
        raise OSError("only text")
