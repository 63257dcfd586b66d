"""Print results as JSON, and check output files so that no input is overwritten."""

import os
from collections.abc import Iterable
from pathlib import Path

import msgspec

from uavrt.core.errors import ConfigError, os_errors_as


def print_json(value: object, *, indent: int = 0) -> None:
    """Print a value as JSON; numbers that are not finite become null (RFC 8259, section 6)."""
    print(msgspec.json.format(msgspec.json.encode(value), indent=indent).decode())


def keep_inputs(output: str | Path, inputs: Iterable[str | Path | None]) -> None:
    """Raise `ConfigError` if an output is one of the inputs, which opening would empty.

    For a SigMF recording, both of its files are protected. Inputs that are not paths are
    skipped.
    """
    target = Path(output)
    if not target.is_file():
        return
    for name in inputs:
        for one in () if name is None else _with_its_other_half(Path(name)):
            if one.is_file() and target.samefile(one):
                raise ConfigError(
                    f"{output} is the input and would be overwritten",
                    remedy="Give -o another name",
                )


def check_place(output: Path, *, overwrite: bool = False) -> None:
    """Raise `ConfigError` if `output` cannot be written, or exists without `overwrite`."""
    if output.is_dir():
        raise ConfigError(f"{output} is a directory", remedy="Name a file in it")
    if output.exists() and not overwrite:
        raise ConfigError(
            f"{output} exists already", remedy="Choose another name, or add --overwrite"
        )
    if not output.parent.is_dir():
        raise ConfigError(f"there is no directory {output.parent}", remedy="Create it first")
    if not os.access(output if output.exists() else output.parent, os.W_OK):
        raise ConfigError(f"{output} cannot be written", remedy="Choose a writable directory")


def make_directory(path: Path, option: str) -> None:
    """Create an output directory before the work starts.

    Raises `ConfigError` with the name of the `option` if that fails.
    """
    with os_errors_as(
        ConfigError, f"{path} cannot be made", f"Choose a writable directory for {option}"
    ):
        path.mkdir(parents=True, exist_ok=True)
    if not os.access(path, os.W_OK):
        raise ConfigError(f"{path} cannot be written", remedy=f"Give {option} a writable path")


def _with_its_other_half(path: Path) -> tuple[Path, ...]:
    stem = path.with_suffix("") if path.suffix.startswith(".sigmf") else path
    return path, Path(f"{stem}.sigmf-meta"), Path(f"{stem}.sigmf-data")
