"""Radios that are not there, for the radios' real programs and for SoapySDR.

Stand-in libraries (`radio_library.c`, `soapy_driver.cpp`) stream samples with a tag's beeps,
and fail as the file ``fault`` says at each moment.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from uavrt.config.radios import RADIOS
from uavrt.config.settings import RadioSettings

DRIVERS = Path(__file__).parent
TAG_HZ = 148_705_000.0
SERIALS = {
    "airspy": "35AC63DC2D8C7A4F",
    "airspyhf": "DD52AAAA12345678",
    "rtlsdr": "00000001",
    "hackrf": "0000000000000000909864c8345017cf",
    "soapy": "77",
}
PACKAGES = {
    "airspy": "airspy",
    "airspyhf": "airspyhf",
    "rtlsdr": "rtl-sdr",
    "hackrf": "hackrf",
    "soapy": "python3-soapysdr libsoapysdr-dev",
}
"""What `make test` installs as root, with a compiler."""
INSTALLED = Path("/var/lib/dpkg/info")
SOAPY_MODULES = Path("/usr/lib/python3/dist-packages")


def missing(kind: str) -> str | None:
    """Name what a test with this radio's own program needs and this computer lacks."""
    if shutil.which("c++" if kind == "soapy" else "cc") is None:
        return "no C compiler: apt install gcc g++"
    if kind != "soapy":
        there = shutil.which(RADIOS[kind].receive) is not None
    else:
        version = f"{sys.version_info.major}{sys.version_info.minor}"
        modules = SOAPY_MODULES.glob(f"_SoapySDR.cpython-{version}-*.so")
        there = any(modules) and Path("/usr/include/SoapySDR").is_dir()
    return None if there else f"apt install {PACKAGES[kind]}"


def usable(kind: str) -> bool:
    """Find whether a radio's own program can be tested here; fail where it should be."""
    reason = missing(kind)
    packages = PACKAGES[kind].split()
    if reason and all(any(INSTALLED.glob(f"{one}[.:]*list")) for one in packages):
        pytest.fail(f"{PACKAGES[kind]} is installed, and cannot be tested: {reason}")
    return reason is None


def needs(kind: str) -> None:
    """Skip a test where the radio's own program is not installed."""
    if not usable(kind):
        pytest.skip(missing(kind) or "")


@cache
def _built(soapy: bool) -> Path:
    """Compile the stand-in libraries once; that of SoapySDR takes the longest."""
    directory = Path(mkdtemp(prefix="radio_library"))
    shared = ("-shared", "-fPIC", "-O2", "-o")
    source, library = DRIVERS / "radio_library.c", directory / "radio_library.so"
    subprocess.run(
        ["cc", *shared, library, source, "-ldl", "-lpthread", "-lm"], check=True, timeout=60
    )
    if soapy:
        source, library = DRIVERS / "soapy_driver.cpp", directory / "libstandin.so"
        subprocess.run(["c++", *shared, library, source, "-lSoapySDR"], check=True, timeout=120)
        for file in SOAPY_MODULES.glob("*SoapySDR*"):
            (directory / file.name).symlink_to(file)
    return directory


class RadioWorld:
    """One computer with its radios; `environment` is what programs there see."""

    def __init__(
        self, directory: Path, kind: str, *, serials: Sequence[str] = (), rates: str = ""
    ) -> None:
        built = _built(kind == "soapy")
        self.directory, self.kind = directory, kind
        self._serials = serials or (SERIALS[kind],)
        directory.mkdir(parents=True, exist_ok=True)
        self.environment = os.environ | {
            "RADIO_WORLD": str(directory),
            "LD_PRELOAD": str(built / "radio_library.so"),
            "SOAPY_SDR_PLUGIN_PATH": str(built),
            "PYTHONPATH": str(built),
        }
        self.write("tag", f"{TAG_HZ:.0f}")
        usual = "3000000 6000000" if kind == "airspy" else "250000 1000000"
        self.write("rates", rates or usual)
        self.write("calls", "")
        self.set("works")

    def write(self, name: str, text: str) -> None:
        """Write a file of the world at once."""
        new = self.directory / f"{name}.new"
        new.write_text(text)
        new.rename(self.directory / name)

    def set(self, fault: str, *, serials: Sequence[str] = ()) -> None:
        """Let this be wrong from now on, with these devices plugged in."""
        if fault == "other serial":
            fault, serials = "works", ("99AA99AA99AA99AA",)
        serials = serials or self._serials
        shutil.rmtree(self.directory / "sys", ignore_errors=True)
        shutil.rmtree(self.directory / "dev", ignore_errors=True)
        (self.directory / "sys").mkdir()
        plugged = RADIOS[self.kind].usb and fault not in ("absent", "unplugged")
        for place, serial in enumerate(serials if plugged else ()):
            vendor, product, _ = RADIOS[self.kind].usb[0]
            device = self.directory / "sys" / f"1-{place}"
            device.mkdir()
            values = {
                "idVendor": vendor,
                "idProduct": product,
                "busnum": "1",
                "devnum": str(place),
                "serial": f"AIRSPY SN:{serial}" if self.kind == "airspy" else serial,
            }
            for name, text in values.items():
                (device / name).write_text(text)
            node = self.directory / "dev" / "001" / f"{place:03d}"
            node.parent.mkdir(parents=True, exist_ok=True)
            if fault != "forbidden":
                node.touch()
        self.write("serials", "".join(f"{one}\n" for one in serials))
        self.write("fault", fault)

    @staticmethod
    def calls_in(directory: Path) -> list[str]:
        """Get the calls of the stand-in library so far, with their values."""
        return (directory / "calls").read_text().splitlines()


def default_radio(kind: str, **changes: object) -> RadioSettings:
    """Set a radio as the first set-up proposes it."""
    rate_hz = 250e3 if kind == "soapy" else RADIOS[kind].usual_rate_hz
    usual: dict[str, object] = {"kind": kind, "sample_rate_hz": rate_hz, "retry_s": 0.2}
    return RadioSettings(**(usual | changes))  # type: ignore[arg-type]
