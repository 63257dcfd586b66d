"""The image of a drone: what is in its root, and that two made of one root are the same."""

import configparser
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import program
from update_maker import make_key

from uavrt.cli.system.run_ground import OWN_COMPONENT
from uavrt.config.loader import load_settings, write_default_settings
from uavrt.config.radios import RADIOS
from uavrt.drone.computer.first_setup import FirstSetup

IMAGE = Path(__file__).parents[2] / "deploy/image"
TOOLS = ("sfdisk", "mkfs.ext4", "mkfs.vfat", "mcopy", "debugfs")
NOBODY = 65534
SEARCHED = os.pathsep.join((os.environ["PATH"], "/usr/sbin", "/sbin"))
PACKING = os.environ | {"EFI_MIB": "40", "PATH": SEARCHED}
needs_disk_tools = pytest.mark.skipif(
    any(shutil.which(tool, path=SEARCHED) is None for tool in TOOLS),
    reason="needs fdisk, e2fsprogs, dosfstools and mtools",
)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """What deploy/install.sh leaves in a root, in small."""
    root = tmp_path / "root"
    version = root / "opt/uavrt/versions/source/bin"
    version.mkdir(parents=True)
    (version / "uavrt").write_text("#!/bin/sh\n")
    (root / "opt/uavrt/venv").symlink_to("versions/source")
    (root / "var/lib/uavrt").mkdir(parents=True)
    write_default_settings(root / "var/lib/uavrt/uavrt.toml")
    (root / "etc/ssh").mkdir(parents=True)
    (root / "etc/ssh/ssh_host_rsa_key").write_text("of the machine that built it")
    (root / "etc/group").write_text("root:x:0:\nshadow:x:42:\n")
    (root / "etc/shadow").write_text("root:*:20000:0:99999:7:::\n")
    (root / "boot").mkdir()
    (root / "boot/vmlinuz-6.1.0-arm64").write_bytes(b"MZ kernel")
    (root / "boot/initrd.img-6.1.0-arm64").write_bytes(b"initrd")
    loader = root / "usr/lib/systemd/boot/efi"
    loader.mkdir(parents=True)
    (loader / "systemd-bootaa64.efi").write_bytes(b"MZ loader")
    return root


def configure(root: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    command = [str(IMAGE / "configure-root.sh"), str(root), *words]
    return program(*command)


def contents(root: Path) -> dict[str, bytes]:
    return {
        path.relative_to(root).as_posix(): os.fsencode(path.readlink())
        if path.is_symlink()
        else path.read_bytes()
        for path in root.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def test_the_root_is_read_only_and_what_changes_lies_on_the_data_partition(root: Path) -> None:
    assert configure(root, "lynx-1").returncode == 0
    lines = (root / "etc/fstab").read_text().splitlines()
    mounts = {place: (what, options) for what, place, _, options, *_ in map(str.split, lines)}
    assert "ro" in mounts["/"][1].split(",")
    assert mounts["/var/lib/uavrt"][0] == "/data/uavrt"
    assert mounts["/opt/uavrt"][0] == "/data/opt"
    for place in mounts:
        assert (root / place.lstrip("/")).is_dir() or mounts[place][0] == "tmpfs"
    assert (root / "etc/hostname").read_text() == "lynx-1\n"
    # The page that runs beside the drone side hears it, and may command it.
    mavlink = load_settings(root / "var/lib/uavrt/uavrt.toml").mavlink
    page = (root / "etc/systemd/system/uavrt-page.service").read_text()
    assert [link.replace("udpin", "udpout") in page for link in mavlink.direct_links] == [True]
    assert f"--command-key {mavlink.key_file}" in page
    assert f"--component-id {OWN_COMPONENT}" in page
    assert "--set-up /var/lib/uavrt/uavrt.toml" in page
    # It has the drone's flights, and its copies of them lie beside.
    recording = load_settings(root / "var/lib/uavrt/uavrt.toml").recording
    assert f"--output /var/lib/uavrt/{recording.directory} " in page
    again = contents(root)
    assert configure(root, "lynx-1").returncode == 0
    assert contents(root) == again


@pytest.fixture
def open_place() -> Iterator[Path]:
    """A directory that another user may reach, too."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.mark.parametrize("builder", ["who runs the tests", "nobody"])
def test_a_root_is_configured_again_without_root_rights(
    root: Path, open_place: Path, builder: str
) -> None:
    """A builder who is not root cannot write again to a file that is read-only by then."""
    there, script = open_place / "root", open_place / "configure-root.sh"
    shutil.copytree(root, there, symlinks=True)
    shutil.copy(IMAGE / "configure-root.sh", script)
    script.chmod(0o755)
    other: dict[str, int] = {}
    if builder == "nobody":
        if os.geteuid():
            pytest.skip("who runs the tests has no root rights")
        other = {"user": NOBODY, "group": NOBODY}
        for path in (there, *there.rglob("*")):
            os.chown(path, NOBODY, NOBODY, follow_symlinks=False)
    found = []
    for name in ("lynx-1", "lynx-1", "lynx-2"):
        done = program(script, there, name, **other)
        assert (done.returncode, done.stderr) == (0, "")
        found.append(contents(there))
    assert found[0] == found[1]
    assert found[2]["etc/hostname"] == b"lynx-2\n"
    assert (there / "etc/sudoers.d/uavrt").stat().st_mode & 0o777 == 0o440


def test_nothing_is_written_where_a_link_leads_out_of_the_root(
    root: Path, tmp_path: Path
) -> None:
    outside = tmp_path / "outside"
    outside.write_text("of this computer")
    (root / "etc/hostname").symlink_to(outside)
    assert configure(root, "lynx-1").returncode == 0
    assert outside.read_text() == "of this computer"
    assert (root / "etc/hostname").read_text() == "lynx-1\n"


@pytest.mark.parametrize("name", ["Lynx", "a b", "-x", "x;reboot", "lynx_1"])
def test_a_name_that_is_no_hostname_is_refused(root: Path, name: str) -> None:
    refused = configure(root, name)
    assert refused.returncode == 1
    assert "is invalid" in refused.stderr


def test_units_and_first_boot_are_well_formed_and_no_secret_is_in_the_root(root: Path) -> None:
    configure(root)
    for unit in root.glob("etc/systemd/system/*.service"):
        parser = configparser.ConfigParser(interpolation=None, strict=True)
        parser.optionxform = str  # type: ignore[assignment, method-assign]
        parser.read_string(unit.read_text())
        wanted = parser["Install"]["WantedBy"]
        link = root / f"etc/systemd/system/{wanted}.wants" / unit.name
        assert str(link.readlink()) == f"/etc/systemd/system/{unit.name}"
    for script in ("uavrt-first-boot", "uavrt-identity"):
        subprocess.run(["sh", "-n", str(root / "usr/local/sbin" / script)], check=True)
    said = b"".join(contents(root).values()).decode(errors="replace")
    assert "psk=$wifi" in said  # made when it starts, not now
    assert "PRIVATE KEY" not in said


def test_the_image_has_the_programs_of_all_radios() -> None:
    lines = (IMAGE / "packages.txt").read_text().splitlines()
    packages = {line for line in lines if line and not line.startswith("#")}
    assert {row.package for row in RADIOS.values() if row.receive} <= packages


class Started:
    """A computer's data partition, and what each start makes of it."""

    def __init__(self, root: Path, place: Path) -> None:
        self.script = root / "usr/local/sbin/uavrt-identity"
        self.data = place / "data"
        for name in ("uavrt", "opt"):
            (self.data / name).mkdir(parents=True)
        # Of the user uavrt, whom the machine of this test need not have.
        tools = place / "tools"
        tools.mkdir(parents=True)
        (tools / "runuser").write_text('#!/bin/sh\nshift 3\nexec "$@"\n')
        (tools / "runuser").chmod(0o755)
        self._path = f"{tools}:{os.environ['PATH']}"

    def start(self) -> dict[str, str]:
        """Start it; who it is then."""
        command = ["sh", str(self.script), str(self.data)]
        environment = os.environ | {"PATH": self._path}
        subprocess.run(command, check=True, env=environment, timeout=60)
        lines = (self.data / "identity").read_text().splitlines()
        return dict(line.split("=", 1) for line in lines)


def test_each_computer_names_itself_and_keeps_its_name(root: Path, tmp_path: Path) -> None:
    configure(root)
    one = Started(root, tmp_path / "one")
    first = one.start()
    assert re.fullmatch("uavrt-[a-z0-9]{4}", first["name"])
    assert one.start() == first
    other = Started(root, tmp_path / "other").start()
    assert not set(first.values()) & set(other.values())
    told = (one.data / "access-point.txt").read_text()
    assert f"http://{first['name']}.local:8650, password {first['page_password']}" in told
    for secret in ("identity", "page.env", "access-point.txt"):
        assert (one.data / secret).stat().st_mode & 0o077 == 0, secret
    configure(root, "lynx-1")
    assert Started(root, tmp_path / "third").start()["name"] == "lynx-1"


def test_what_the_page_has_set_up_counts_from_the_next_start(
    root: Path, tmp_path: Path
) -> None:
    configure(root)
    computer = Started(root, tmp_path)
    before = computer.start()
    write_default_settings(computer.data / "uavrt/uavrt.toml")
    setup = FirstSetup(computer.data / "uavrt/uavrt.toml")
    assert not setup.save_step("name", {"name": "lynx-2"})
    _, keys = make_key(tmp_path, "release")
    given = {"page_password": "marmot-2026", "update_key": keys}
    assert not setup.save_step("keys", given)
    after = computer.start()
    assert after == before | {"name": "lynx-2", "page_password": "marmot-2026"}
    environment = (computer.data / "page.env").read_text()
    assert "UAVRT_GROUND_PASSWORD=marmot-2026\nUAVRT_HOST_NAME=lynx-2.local\n" in environment
    assert f"WIFI:T:WPA;S:lynx-2;P:{before['wifi_password']};;" in environment
    access_point = (computer.data / "network/uavrt-access-point.nmconnection").read_text()
    assert "ssid=lynx-2\n" in access_point
    assert (computer.data / "opt/update-keys.pem").read_text() == keys
    # Taken once, and a later key needs an update that this one has signed.
    assert not (computer.data / "uavrt/set-up.conf").exists()
    (computer.data / "uavrt/update-keys.pem").write_text(keys.replace("A", "B"))
    assert computer.start() == after
    assert (computer.data / "opt/update-keys.pem").read_text() == keys


@pytest.mark.parametrize(
    "handed",
    [
        "name=lynx; reboot\nwifi_password=a b\npage_password=short\n",
        "name=-x\nname=LYNX\nwifi_password=1234567\n",
        "name=lynx\x00\npage_password=$(reboot)xxxxxxxx\n",
        "",
        "\x80\xff" * 3000,
    ],
)
def test_what_root_is_handed_is_believed_only_if_it_looks_right(
    root: Path, tmp_path: Path, handed: str
) -> None:
    configure(root, "lynx-1")
    computer = Started(root, tmp_path)
    before = computer.start()
    (computer.data / "uavrt/set-up.conf").write_bytes(handed.encode("latin-1"))
    assert computer.start() == before


def packed(root: Path, image: Path) -> bytes:
    """The small image of a root."""
    program(IMAGE / "pack.sh", root, image, check=True, env=PACKING)
    return image.read_bytes()


@needs_disk_tools
def test_an_image_holds_what_it_should(root: Path, tmp_path: Path) -> None:
    configure(root)
    image = tmp_path / "one.img"
    whole = packed(root, image)
    listed = program("sfdisk", "-J", image, check=True, env=PACKING)
    table = json.loads(listed.stdout)["partitiontable"]
    parts = {part["name"]: part for part in table["partitions"]}
    assert table["label"] == "gpt"
    assert list(parts) == ["uavrt-efi", "uavrt-root", "uavrt-data"]
    for name, part in parts.items():
        begin = 512 * part["start"]
        (tmp_path / name).write_bytes(whole[begin : begin + 512 * part["size"]])

    def read(part: str, path: str, what: str = "cat") -> str:
        words = ("debugfs", "-R", f"{what} {path}", tmp_path / part)
        return program(*words, check=True, env=PACKING).stdout

    assert "LABEL=uavrt-data" in read("uavrt-root", "/etc/fstab")
    for path, mode, group in (("/etc/shadow", "0640", 42), ("/etc/fstab", "0644", 0)):
        told = read("uavrt-root", path, "stat")
        assert re.search(rf"Mode:\s+{mode}\b", told), told
        assert re.search(rf"User:\s+0\s+Group:\s+{group}\b", told), told
    assert read("uavrt-root", "/etc/ssh/ssh_host_rsa_key") == ""
    assert read("uavrt-root", "/opt/uavrt/versions/source/bin/uavrt") == ""
    assert read("uavrt-data", "/opt/versions/source/bin/uavrt") == "#!/bin/sh\n"
    assert "address" in read("uavrt-data", "/uavrt/uavrt.toml")
    words = ("mtype", "-i", tmp_path / "uavrt-efi", "::loader/entries/uavrt.conf")
    entry = program(*words, check=True, env=PACKING).stdout
    assert f"root=partuuid={parts['uavrt-root']['uuid']}".lower() in entry.lower()
    assert "initrd /initrd" in entry
