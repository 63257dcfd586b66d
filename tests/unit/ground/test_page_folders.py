"""Sources of the page: folders of at most 15 entries, without circles of imports."""

import os
import re
from graphlib import TopologicalSorter

from page_texts import PAGE

IMPORT = re.compile(r'(?:from|import) "(\.[^"]*)"')
MODULES = {
    str(path.relative_to(PAGE).with_suffix("")): path.read_text(encoding="utf-8")
    for path in sorted(PAGE.rglob("*.ts"))
}
IMPORTED = {
    name: {
        os.path.normpath(f"{os.path.dirname(name)}/{one}".lstrip("/"))
        for one in IMPORT.findall(text)
    }
    & MODULES.keys()
    for name, text in MODULES.items()
}


def folder_of(name: str) -> str:
    return os.path.dirname(name) or name


def test_no_two_modules_or_folders_of_the_page_import_each_other() -> None:
    folders: dict[str, set[str]] = {}
    for name, imported in IMPORTED.items():
        others = {folder_of(one) for one in imported} - {folder_of(name)}
        folders.setdefault(folder_of(name), set()).update(others)
    assert sum(map(len, IMPORTED.values())) > 100
    for graph in (IMPORTED, folders):
        TopologicalSorter(graph).prepare()


def test_no_folder_of_the_page_has_more_than_15_entries() -> None:
    for folder in (PAGE, *(path for path in PAGE.rglob("*") if path.is_dir())):
        assert 0 < len(list(folder.iterdir())) <= 15, folder
