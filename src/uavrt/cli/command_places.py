"""Location of each command's code: folder and module."""

_FOLDERS = {
    "system": "demo run ground fly fetch simulate monitor",
    "signals": "detect attach tags channelize",
    "results": "bearing localize integrate batch archive report season export",
    "prediction": "range coverage",
    "computer": "doctor service starter update",
}
_FOLDER_OF = {name: folder for folder, some in _FOLDERS.items() for name in some.split()}


def module_of(command: str) -> str:
    """Full name of the module of a command."""
    return f"uavrt.cli.{_FOLDER_OF[command]}.{command}"
