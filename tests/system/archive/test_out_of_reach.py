"""What was done of a recording on a web server stays while the server is away."""

from pathlib import Path

import fsspec
import pytest
from archived import TAGS, record
from command_line import uavrt
from http_store import served
from tests.unit.archive.test_out_of_reach import count, found_in

from uavrt.analysis.archive import object_stores as stores
from uavrt.analysis.archive.parquet.questions import ask


def test_a_store_that_is_away_takes_no_pulse_along(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("aiohttp", reason="fsspec[http] is not installed")
    web, output = tmp_path / "web", tmp_path / "searched"
    web.mkdir()
    record(web / "walk.cf32", 30.0, 1, tags=TAGS[:1])
    (tmp_path / "tags.txt").write_text("2, 148706000, 1210, 20, 20, 10, 3, 0.02\n")
    nothing = tmp_path / "local"
    nothing.mkdir()
    with served(web) as (_, address):
        url = f"{address}/walk.cf32"
        found_in(tmp_path, url, nothing)
        command = (
            *("batch", str(nothing), "--tags", str(tmp_path / "tags.txt"), "--workers", "1"),
            *("--manifest", str(tmp_path / "manifest.csv"), "-o", str(output)),
        )
        assert uavrt(*command) == 0
        before = count(output)
        assert before > 20
    # Another run knows nothing of the lines that this one opened.
    fsspec.filesystem("http").clear_instance_cache()
    stores._opened.cache_clear()
    capsys.readouterr()
    assert uavrt(*command) == 1
    said = capsys.readouterr().err
    assert f"{url}: earlier result kept, not reachable now:" in said
    assert "earlier results kept, not reachable now: 1" in said
    assert count(output) == before
    assert ask(output, "select state from recordings")["state"].to_pylist() == ["done"]
    # The same with other settings, of which nothing is done yet.
    assert uavrt(*command, "--cell", "70") == 1
    assert count(output) == before
