"""What two builds of an image leave is the same, wherever and whenever each was made."""

import hashlib
import os
import py_compile
import shutil
from pathlib import Path

import pytest
from command_line import program
from tests.system.test_image import PACKING, contents, needs_disk_tools, packed
from toy_installer import ToyInstaller

DEPLOY = Path(__file__).parents[2] / "deploy"
NO_EMULATION = 3
OWN, REMOVED, ADDED, FOREIGN = (
    f"-----BEGIN CERTIFICATE-----\n{whose}\n-----END CERTIFICATE-----\n"
    for whose in ("own", "removed", "added", "builder")
)


def test_a_program_that_was_installed_twice_is_the_same(tmp_path: Path) -> None:
    """Each time it is built in another temporary directory, which nothing may name."""
    toy = ToyInstaller(tmp_path)
    found = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        shutil.rmtree(toy.root, ignore_errors=True)
        done = toy.install(temporary=tmp_path / name)
        assert done.returncode == 0, done.stdout + done.stderr
        whole = contents(toy.root)
        found.append({path: whole[path] for path in whole if "__pycache__" not in path})
    one, two = found
    assert any(path.endswith("uavrt/config/loader.py") for path in one)
    assert sorted(one) == sorted(two)
    assert [path for path in one if one[path] != two[path]] == []
    assert [path for path, what in one.items() if os.fsencode(tmp_path / "a") in what] == []


def make_root(root: Path, builder: str) -> Path:
    """A root in which a build has left what differs from one to the next."""
    for name, text in {
        "etc/group": "root:x:0:\n",
        "etc/machine-id": "",
        "usr/share/ca-certificates/mozilla/Own.crt": OWN.rstrip("\n"),
        "usr/share/ca-certificates/mozilla/Removed.crt": REMOVED,
        "usr/local/share/ca-certificates/added.crt": ADDED,
        "etc/ca-certificates.conf": "# kept\nmozilla/Own.crt\n!mozilla/Removed.crt\n",
        "etc/ssl/certs/ca-certificates.crt": OWN + FOREIGN + builder,
        "etc/ssh/ssh_host_ed25519_key": builder,
        "etc/NetworkManager/system-connections/home.nmconnection": builder,
        "etc/passwd-": builder,
        "root/.ssh/authorized_keys": builder,
        "root/.cache/pip/http/0": builder,
        "root/.bash_history": builder,
        "home/pi/.ssh/id_ed25519": builder,
        "home/pi/.cache/x": builder,
        "var/cache/apt/pkgcache.bin": builder,
        "var/cache/debconf/config.dat-old": builder,
        "var/lib/apt/lists/deb.debian.org_InRelease": builder,
        "var/lib/dpkg/status": "Package: x\n",
        "var/lib/dpkg/status-old": builder,
        "var/lib/dbus/machine-id": builder,
        "var/lib/systemd/random-seed": builder,
        "var/lib/systemd/credential.secret": builder,
        "var/lib/NetworkManager/secret_key": builder,
        "var/log/dpkg.log": builder,
        "var/tmp/x": builder,
        "tmp/x": builder,
        "usr/lib/python3/module.py": "VALUE = 1\n",
        "opt/uavrt/versions/source/lib/module.py": "VALUE = 1\n",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    # Real ones: the cache of ldconfig holds inodes and times, and so do some bytecodes.
    (root / "usr/lib/libm.so.6").write_bytes(Path(find_library()).read_bytes())
    (root / "lib").symlink_to("usr/lib")
    program("ldconfig", "-r", root, check=True, env=PACKING)
    modes = py_compile.PycInvalidationMode
    module = root / "usr/lib/python3/module.py"
    os.utime(module, (len(builder), 1e9 + len(builder)))
    py_compile.compile(str(module), dfile="/m", invalidation_mode=modes.TIMESTAMP)
    kept = root / "opt/uavrt/versions/source/lib/module.py"
    py_compile.compile(str(kept), dfile="/m", invalidation_mode=modes.UNCHECKED_HASH)
    return root


def find_library() -> str:
    listed = program("ldconfig", "-p", check=True, env=PACKING)
    return next(
        line.split(" => ")[1] for line in listed.stdout.splitlines() if "libm.so.6" in line
    )


@needs_disk_tools
def test_images_of_two_builds_are_the_same_and_trust_nobody_else(tmp_path: Path) -> None:
    sums = []
    for builder in ("ann's", "ben's own"):
        root = make_root(tmp_path / builder, builder)
        whole = packed(root, tmp_path / f"{builder}.img")
        assert builder.encode() not in whole
        assert (OWN + ADDED).encode() in whole
        assert (OWN + FOREIGN).encode() not in whole
        assert b"VALUE" in whole
        sums.append(hashlib.sha256(whole).hexdigest())
        assert (root / "etc/ssh/ssh_host_ed25519_key").exists()  # only the copy is cleaned
    assert sums[0] == sums[1]


def test_a_command_in_the_emulated_root_leaves_nothing_of_this_computer_there(
    tmp_path: Path,
) -> None:
    """It has this computer's network and trust while it runs; `chroot` is a stand-in here."""
    root = tmp_path / "work/root"
    for name in ("etc/ssl/certs", "proc", "dev", "run"):
        (root / name).mkdir(parents=True)
    (root / "etc/ssl/certs/ca-certificates.crt").write_text(OWN)
    (root / "etc/resolv.conf").symlink_to("/run/NetworkManager/resolv.conf")
    (root / "etc/hosts").write_text("127.0.0.1 lynx-1\n")
    emulator = tmp_path / "work/qemu-aarch64-static"
    shutil.copy("/bin/true", emulator)
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "chroot").write_text("""#!/bin/sh
cat "$1/etc/hosts" "$1/run/NetworkManager/resolv.conf"
for word in "$@"; do case $word in PIP_CERT=*) cmp "$1${word#*=}" "$BUNDLE" ;; esac; done
""")
    (tools / "chroot").chmod(0o755)
    before = contents(root)
    bundle = "/etc/ssl/certs/ca-certificates.crt"
    settings = {"PATH": f"{tools}:{os.environ['PATH']}", "BUNDLE": bundle}
    done = program(
        DEPLOY / "arm64/enter.sh", tmp_path / "work", "true", env=os.environ | settings
    )
    if done.returncode == NO_EMULATION:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    lent = Path("/etc/hosts").read_text() + Path("/etc/resolv.conf").read_text()
    assert done.stdout == lent
    assert contents(root) == before
