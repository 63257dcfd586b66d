"""The page's sources are sound, and a text without an id, or one built from pieces, is not."""

import shutil
import subprocess
from pathlib import Path

import pytest
from page_texts import PAGE

FAULTS = {
    'say(by("main"), t("main.unheard_of"))': "not assignable to parameter of type",
    'say(by("main"), "No contact")': "not assignable to parameter of type 'Shown'",
    'say(by("main"), `${t("main.no_flight")}: ${t("main.ended")}`)': "of type 'Shown'",
    'h("p", {}, "No contact with the drone")': "not assignable to parameter of type 'Child'",
    'h("p", { title: "No contact" })': "not assignable to type 'Shown | undefined'",
    't("main.loss", { share: "a half" })': "not assignable to type 'number | Words'",
    'toast("Copied", 6)': "not assignable to parameter of type 'Words'",
}
IMPORTS = """import { by, h, say } from "./shared/dom";
import { t } from "./shared/i18n";
import { toast } from "./shared/notice";
void [by, h, say, t, toast];
"""


def reported(page: Path) -> list[str]:
    """Errors of the compiler in a copy of the page."""
    run = subprocess.run(
        [PAGE.parent / "node_modules/.bin/tsc", "--noEmit"],
        cwd=page,
        capture_output=True,
        text=True,
        check=False,
    )
    assert bool(run.stdout) == bool(run.returncode), run.stderr
    return run.stdout.splitlines()


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    page = tmp_path / "page"
    shutil.copytree(PAGE, page / "src")
    for name in ("tsconfig.json", "vite.config.ts", "package.json"):
        shutil.copy(PAGE.parent / name, page)
    (page / "node_modules").symlink_to(PAGE.parent / "node_modules")
    return page


def test_the_page_compiles_and_each_fault_in_a_text_does_not(copied: Path) -> None:
    assert reported(copied) == []
    lines = [*IMPORTS.splitlines(), *(f"{fault};" for fault in FAULTS)]
    (copied / "src/faults.ts").write_text("\n".join(lines) + "\n", encoding="utf-8")
    errors = [line for line in reported(copied) if line.startswith("src/")]
    first = len(IMPORTS.splitlines()) + 1
    assert len(errors) == len(FAULTS)
    for number, wanted in enumerate(FAULTS.values(), first):
        (error,) = [one for one in errors if one.startswith(f"src/faults.ts({number},")]
        assert wanted in error
