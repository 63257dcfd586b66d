"""Fixtures for experiments: their tables name a commit without running git."""

import pytest


@pytest.fixture(autouse=True)
def commit_of_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every table name the same commit."""
    monkeypatch.setattr("uavrt_experiments.measured.commit", lambda: "0123abc")
