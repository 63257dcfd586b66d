"""Read an update file: its contents, its signature, and whether it is complete.

A ``.tar`` holds a program and all its libraries::

    update.json        the manifest: version, and of each wheel its name, size and SHA-256
    update.sig         Ed25519 signature (RFC 8032) of the manifest's bytes, 64 bytes
    wheels/NAME.whl    for several processors and Pythons, if wanted

A ``.whl`` holds the program alone and uses the installed libraries; its signature is in
``FILE.whl.sig``. Nothing in either file is unpacked or run before its signature is verified.

Signatures are checked by ``openssl`` (``pkeyutl -rawin``, OpenSSL 3). The accepted public keys
are in one file, as consecutive PEM blocks; only root may write this file.
"""

import hashlib
import io
import re
import stat
import subprocess
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from email.parser import BytesHeaderParser
from pathlib import Path
from typing import Annotated

import msgspec

from uavrt.core.errors import FormatError, NotFound, UsageError, os_errors_as
from uavrt.core.foreign import KEYS, Limit, decode_record, read_file, require_plain_file

MANIFEST, SIGNATURE, WHEELS = "update.json", "update.sig", "wheels"
FORMAT = 1
MOST_MANIFEST_BYTES = 1_000_000
MOST_WHEEL_BYTES = 500_000_000
MOST_MEMBERS = 2000
SIGNATURE_BYTES = 64
ZIP_FAULTS = (zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError, zlib.error)
_WHEEL = re.compile(r"[A-Za-z0-9_.]+-[A-Za-z0-9_.!+]+(-\d\w*)?(-[A-Za-z0-9_.]+){3}\.whl")
_KEY = re.compile(r"-----BEGIN PUBLIC KEY-----\n[A-Za-z0-9+/=\n]+-----END PUBLIC KEY-----\n")
_VERSION = re.compile(
    r"(\d+(?:\.\d+)*)(?:(a|b|rc)(\d+))?(?:\.post(\d+))?(?:\.dev(\d+))?(?:\+([a-z0-9.]+))?"
)
COPY_AGAIN = "Copy the file once more, and compare its size with the original's"
_MAKER = "Ask its maker for a corrected file"


class Wheel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Entry of a manifest: name, size [bytes] and SHA-256 of one Python wheel."""

    name: str
    bytes: Annotated[int, msgspec.Meta(ge=1, le=MOST_WHEEL_BYTES)]
    sha256: Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{64}$")]


class Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Contents of ``update.json``: version, list of wheels, and new public keys, if any."""

    format: int
    version: str
    files: Annotated[tuple[Wheel, ...], msgspec.Meta(min_length=1, max_length=500)]
    keys: str | None = None
    """Public keys that verify later updates and replace the previous ones; None: unchanged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Update:
    """An update with a valid signature."""

    path: Path
    version: str
    name: str
    """Name of the update: version, and first digits of the hash of its content."""
    alone: bool
    """True if the update contains only uavrt, without the libraries that it needs."""
    manifest: Manifest | None
    """Manifest of a ``.tar``; None for a single wheel."""
    content: bytes | None = None
    """Signed bytes of a single wheel, read once so that the file cannot change; else None."""


def version_key(version: str) -> tuple[object, ...]:
    """Return a version's sort key (PEP 440, without epochs); raises `FormatError`.

    >>> version_key("0.10.0") > version_key("0.9.1") > version_key("0.9.1rc2")
    True
    """
    found = _VERSION.fullmatch(version)
    if found is None:
        raise FormatError(f"{version!r} is not a version of uavrt", remedy=COPY_AGAIN)
    numbers, stage, stage_number, post, dev, local = found.groups()
    release = [int(number) for number in numbers.split(".")]
    while release and release[-1] == 0:
        release.pop()
    before = -1 if stage is None and post is None and dev is not None else 3
    rank = {"a": 0, "b": 1, "rc": 2, None: before}[stage]
    return (
        tuple(release),
        rank,
        int(stage_number or 0),
        -1 if post is None else int(post),
        1 if dev is None else 0,
        int(dev or 0),
        local or "",
    )


def read_update(path: Path, keys: Path) -> Update:
    """Read an update and verify its signature; nothing is unpacked."""
    with os_errors_as(UsageError, f"{path} cannot be read"):
        if path.suffix == ".whl":
            return _read_wheel(path, keys)
        with _opened(path) as archive:
            text, signature = (_member(archive, name) for name in (MANIFEST, SIGNATURE))
    require_signed(text, signature, keys, path)
    manifest = _manifest(text, path)
    return Update(
        path=path,
        version=manifest.version,
        name=f"{manifest.version}-{hashlib.sha256(text).hexdigest()[:8]}",
        alone=False,
        manifest=manifest,
    )


def _read_wheel(path: Path, keys: Path) -> Update:
    if not _WHEEL.fullmatch(path.name) or not path.name.startswith("uavrt-"):
        raise FormatError(f"{path} does not have the name of a uavrt wheel", remedy=COPY_AGAIN)
    content = read_file(path, Limit(what="a wheel", bytes=MOST_WHEEL_BYTES))
    signature_path = path.with_name(f"{path.name}.sig")
    try:
        signature = read_file(signature_path, Limit(what="a signature", bytes=SIGNATURE_BYTES))
    except FileNotFoundError:
        remedy = "Copy the signature as well, or use a .tar, which contains one"
        raise NotFound(f"there is no {signature_path}", remedy=remedy) from None
    require_signed(content, signature, keys, path)
    version = _wheel_version(content, path)
    version_key(version)
    name = f"{version}-{hashlib.sha256(content).hexdigest()[:8]}"
    return Update(
        path=path, version=version, name=name, alone=True, manifest=None, content=content
    )


def _wheel_version(content: bytes, path: Path) -> str:
    named = path.name.split("-")[1]
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entry = archive.getinfo(f"uavrt-{named}.dist-info/METADATA")
            if entry.file_size > MOST_MANIFEST_BYTES:
                raise ValueError("the METADATA file is too large")
            metadata = BytesHeaderParser().parsebytes(archive.read(entry))
    except KeyError:
        text = f"{path} does not contain uavrt {named}, contrary to its name"
        raise FormatError(text, remedy="Restore the original file name") from None
    except (ValueError, RuntimeError, OSError, EOFError, *ZIP_FAULTS) as error:
        raise FormatError(f"{path} is not a wheel: {error}", remedy=COPY_AGAIN) from error
    if (metadata["Name"], metadata["Version"]) != ("uavrt", named):
        raise FormatError(
            f"{path} holds {metadata['Name']} {metadata['Version']}, not uavrt {named}",
            remedy="Restore the original file name",
        )
    return named


def unpack_wheels(update: Update, directory: Path) -> None:
    """Write the wheels of a ``.tar``; raises `FormatError` if one differs from its entry."""
    assert update.manifest is not None
    with _opened(update.path) as archive:
        for wheel in update.manifest.files:
            content = _member(archive, f"{WHEELS}/{wheel.name}", wheel.bytes)
            if hashlib.sha256(content).hexdigest() != wheel.sha256:
                text = f"{update.path}: {wheel.name} is not the file that was signed"
                raise FormatError(text, remedy=COPY_AGAIN)
            (directory / wheel.name).write_bytes(content)


@contextmanager
def _opened(path: Path) -> Iterator[tarfile.TarFile]:
    try:
        require_plain_file(path)
        _check_headers(path)
        with tarfile.open(path, "r:") as archive:
            yield archive
    except (tarfile.TarError, EOFError, ValueError, OverflowError) as error:
        raise FormatError(
            f"{path} is not an update, or is damaged: {error}", remedy=COPY_AGAIN
        ) from error


def _check_headers(path: Path) -> None:
    """Reject tar headers with impossible sizes before `tarfile` reads them.

    Blocks of 512 bytes (POSIX.1-2017, pax): at 124 the size of the content in octal, at 156 its
    kind. Sizes beyond the file and invalid names are rejected.
    """
    there = path.stat().st_size
    at = 0
    with path.open("rb") as file:
        for _ in range(MOST_MEMBERS):
            file.seek(at)
            block = file.read(512)
            if len(block) < 512 or not any(block):
                return
            size = int(block[124:136].split(b"\0")[0].strip() or b"0", 8)
            kind = block[156:157]
            plain = kind in (b"0", b"\0")
            if not 0 <= size <= (there if plain else MOST_MANIFEST_BYTES):
                raise ValueError(
                    f"a file header declares {size:,} bytes, but the archive has only {there:,}"
                )
            more = file.read(size) if kind in (b"x", b"X") else b""
            if kind in (b"S", b"g") or b" size=" in more or b" GNU.sparse" in more:
                raise ValueError("the tar format is not supported")
            at += 512 + -(-size // 512) * 512
    raise ValueError(f"the archive has more than {MOST_MEMBERS} files")


def _member(archive: tarfile.TarFile, name: str, size: int | None = None) -> bytes:
    try:
        member = archive.getmember(name)
    except KeyError:
        text = f"{archive.name!s}: {name} is missing; the file is truncated, or no update"
        raise FormatError(text, remedy=COPY_AGAIN) from None
    most = MOST_MANIFEST_BYTES if size is None else size
    if not member.isreg() or member.size > most or (size is not None and member.size != size):
        raise FormatError(
            f"{archive.name!s}: {name} does not match its manifest", remedy=COPY_AGAIN
        )
    file = archive.extractfile(member)
    content = b"" if file is None else file.read()
    if len(content) != member.size:
        raise FormatError(f"{archive.name!s}: {name} is truncated", remedy=COPY_AGAIN)
    return content


def _manifest(text: bytes, path: Path) -> Manifest:
    try:
        manifest = decode_record(text, Manifest)
    except FormatError as error:
        raise FormatError(f"{path}: {MANIFEST} cannot be read: {error}") from error
    if manifest.format != FORMAT:
        text_ = f"{path} is an update of format {manifest.format}; this version reads {FORMAT}"
        raise FormatError(text_, remedy="First update to an intermediate version")
    if not all(_WHEEL.fullmatch(wheel.name) for wheel in manifest.files):
        text_ = f"{path}: {MANIFEST} lists files that are not wheels"
        raise FormatError(text_, remedy=_MAKER)
    if manifest.keys is not None and not split_keys(manifest.keys):
        raise FormatError(f"{path} contains invalid new keys", remedy=_MAKER)
    version_key(manifest.version)
    return manifest


def split_keys(text: str) -> list[str]:
    """Return the PEM blocks of a text, one for each public key."""
    return _KEY.findall(text)


def require_signed(content: bytes, signature: bytes, keys: Path, path: Path) -> None:
    """Raise `UsageError` unless the content has a valid signature.

    The file of accepted keys must be writable for root only.
    """
    trusted = _trusted(keys)
    if len(signature) == SIGNATURE_BYTES:
        with tempfile.TemporaryDirectory(prefix="uavrt-update-") as name:
            place = Path(name)
            (place / "content").write_bytes(content)
            (place / "signature").write_bytes(signature)
            for key in trusted:
                (place / "key").write_text(key, encoding="ascii")
                if _signed_by(place):
                    return
    raise UsageError(
        f"{path} is not signed with an accepted key, or was changed after it was signed",
        remedy=f"{COPY_AGAIN}; the accepted keys are in {keys}",
    )


def _trusted(keys: Path) -> list[str]:
    with os_errors_as(
        UsageError,
        f"no accepted keys: {keys}",
        f"Put the public key of the updates' maker there: sudo cp KEY.pem {keys}",
    ):
        trusted = split_keys(read_file(keys, KEYS).decode("ascii", "replace"))
        mode = stat.S_IMODE(keys.stat().st_mode)
    if mode & 0o022:
        remedy = f"Check who has changed the file, then run: sudo chmod 644 {keys}"
        raise UsageError(f"users other than root can write to {keys}", remedy=remedy)
    if not trusted:
        remedy = "A public key begins with -----BEGIN PUBLIC KEY-----"
        raise NotFound(f"there is no key in {keys}", remedy=remedy)
    return trusted


def _signed_by(place: Path) -> bool:
    command = ["openssl", "pkeyutl", "-verify", "-rawin", "-pubin", "-inkey", "key"]
    command += ["-in", "content", "-sigfile", "signature"]
    try:
        done = subprocess.run(command, cwd=place, capture_output=True, check=False)
    except FileNotFoundError:
        remedy = "Run: sudo apt install openssl"
        raise UsageError(
            "openssl is not installed: signatures cannot be checked", remedy=remedy
        ) from None
    return done.returncode == 0
