"""The source distribution: what builds of it needs no Node."""

import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
from by_path import module_at

ROOT = Path(__file__).parents[2]


def test_the_source_distribution_holds_the_page_of_its_own_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    built = module_at(ROOT / "hatch_build.py")
    if not built.page_is_built(ROOT):
        pytest.skip("the page is not built: python hatch_build.py page")
    hatchling = Path(sys.executable).with_name("hatchling")
    command = [str(hatchling), "build", "-t", "sdist", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        opened.extractall(tmp_path, filter="data")
    root = archive.with_name(archive.name.removesuffix(".tar.gz"))
    index = (root / "src/uavrt/ground/static/index.html").read_text()
    assert "/assets/index-" in index
    assert not (root / "page/node_modules").exists()
    theirs = module_at(root / "hatch_build.py")
    monkeypatch.setattr(theirs, "node_of_machine", lambda: None)
    assert theirs.page_is_built(root)
    theirs.build_page(root)  # nothing to do, and no Node asked for
    (root / "page/index.html").write_text("changed")
    with pytest.raises(theirs.PageError, match="Node"):
        theirs.build_page(root)
