import stat
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from some import some
from until import until

from uavrt.config.settings import RadioSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import ConfigError, RadioMissing, RadioStalled, RadioStopped
from uavrt.radio.checking import check_device
from uavrt.radio.formats import sample_format
from uavrt.radio.opening import open_radio
from uavrt.radio.receivers.radio_program import ProgramSource
from uavrt.radio.receivers.radio_programs import PROGRAMS, receive_command
from uavrt_experiments.resources.usage import is_alive

Install = Callable[[str, str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a stand-in program on the path, and nothing else."""
    monkeypatch.setenv("PATH", str(tmp_path))

    def put(name: str, body: str) -> None:
        path = tmp_path / name
        path.write_text(f"#!{sys.executable}\nimport os, sys, time\n{textwrap.dedent(body)}")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    return put


def gone(pid: int) -> bool:
    return not Path(f"/proc/{pid}").exists()


SERIAL = "644064DC2F5A5ECD"
PACED = """
begun, sent = time.monotonic(), 0
while True:
    sent += os.write(1, bytes([0, 0, 0, 60] * 2 * 65536)) // 8
    time.sleep(max(0.0, begun + sent / 3e6 - time.monotonic()))
"""
RADIOS: list[tuple[RadioSettings, str]] = [
    (
        RadioSettings(kind="airspy", bias_tee=True, serial=f"0x{SERIAL}"),
        f"-r - -f 148.700500 -p 0 -a 3000000 -t 0 -h 21 -b 1 -s 0x{SERIAL}",
    ),
    (
        RadioSettings(kind="airspy", gain=12, frequency_correction_ppm=-2.0, serial=SERIAL),
        f"-r - -f 148.700797 -p 0 -a 3000000 -t 0 -h 12 -b 0 -s 0x{SERIAL}",
    ),
    (
        RadioSettings(kind="airspyhf", sample_rate_hz=768e3, gain=5, serial="AB"),
        "-r stdout -f 148.700500 -a 768000 -g off -m on -t 3 -s 0xAB",
    ),
    (
        RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, frequency_correction_ppm=51.0),
        "-f 148700500 -s 250000 -g 40 -b 16384 -p 51 -",
    ),
    (
        RadioSettings(kind="hackrf", gain=70, serial="7", bias_tee=True),
        "-r - -f 148700500 -s 3000000 -l 32 -g 38 -a 0 -p 1 -d 7",
    ),
]


@pytest.mark.parametrize(
    ("settings", "arguments"), RADIOS, ids=lambda x: getattr(x, "kind", "")
)
def test_each_radio_is_started_with_its_arguments_and_its_samples_are_read(
    install: Install, settings: RadioSettings, arguments: str
) -> None:
    program = PROGRAMS[settings.kind]
    expected = np.arange(-100, 100).repeat(2).astype(np.float32)
    stored = sample_format(program.sample_format)
    data = (expected / 128 * stored.full_scale + stored.zero).astype(stored.dtype)
    install("rtl_biast", "print('bias', sys.argv[1:])")
    install(
        program.receive,
        f"""
        if sys.argv[1:] != {arguments.split()!r}:
            sys.exit("wrong arguments: " + " ".join(sys.argv[1:]))
        data = bytes.fromhex({data.tobytes().hex()!r})
        while True:
            os.write(1, data)
        """,
    )
    source = open_radio(settings, 148_700_500.0)
    try:
        block = source.read(timeout_s=30.0)
        assert block is not None
        first = block.samples[:200].view(np.float32)[::2] * 128
        np.testing.assert_allclose(first[:200], expected[::2], atol=0.51)
    finally:
        source.close()


def test_the_bias_tee_of_an_rtl_dongle_is_switched_before_it_is_started(
    install: Install, tmp_path: Path
) -> None:
    install("rtl_biast", f"open({str(tmp_path / 'said')!r}, 'w').write(' '.join(sys.argv[1:]))")
    install("rtl_sdr", "os.write(1, bytes(10**6))")
    settings = RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, bias_tee=True, serial="9")
    open_radio(settings, 148e6).close()
    assert (tmp_path / "said").read_text() == "-d 9 -b 1"


DONGLES = """
import itertools
serials = ["77770001", "00000001", "AB"]
print("Found 3 device(s):", file=sys.stderr)
for place, serial in enumerate(serials):
    print(f"  {place}:  Realtek, RTL2838UHIDIR, SN: {serial}", file=sys.stderr)
wanted = sys.argv[sys.argv.index("-d") + 1]
# As librtlsdr does: a number below the count is a place, else the serial number counts.
place = int(wanted) if wanted.isdigit() and int(wanted) < 3 else None
if place is None and wanted not in serials:
    sys.exit("No matching devices found.")
opened = serials[place] if place is not None else wanted
open(RECORD, "a").write(opened + " ")
os.write(1, bytes(10**6))
"""


@pytest.mark.parametrize("serial", ["00000001", "77770001", "AB", "2"])
def test_the_dongle_with_the_serial_number_is_opened_and_not_the_one_at_that_place(
    install: Install, tmp_path: Path, serial: str
) -> None:
    record = tmp_path / "opened"
    for name in ("rtl_sdr", "rtl_biast"):
        install(name, f"RECORD = {str(record)!r}\n{DONGLES}")
    settings = RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, bias_tee=True, serial=serial)
    source = open_radio(settings, 148e6)
    assert source.read(timeout_s=30.0) is not None
    source.close()
    wanted = "AB" if serial == "2" else serial  # a place, as it was
    assert record.read_text().split() == [wanted, wanted], "bias voltage and samples"


def test_a_serial_number_of_digits_that_is_not_there_names_those_that_are(
    install: Install,
) -> None:
    for name in ("rtl_sdr", "rtl_biast"):
        install(name, f"RECORD = '/dev/null'\n{DONGLES}")
    settings = RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, serial="00000002")
    with pytest.raises(RadioMissing, match=r'00000002.*"00000001" or "77770001" or "AB"'):
        open_radio(settings, 148e6)


def test_a_program_in_place_of_the_usual_one_gets_its_arguments_after_its_own() -> None:
    settings = RadioSettings(program=("python3", "-m", "x"))
    command = receive_command(settings, 148.5e6)
    assert command[:5] == ["python3", "-m", "x", "-r", "-"]


@pytest.mark.parametrize("kind", PROGRAMS)
def test_a_program_that_is_not_there_names_its_package(install: Install, kind: str) -> None:
    settings = RadioSettings(kind=kind, sample_rate_hz=PROGRAMS[kind].rates_hz[0][0])
    with pytest.raises(RadioMissing, match=f"sudo apt install {PROGRAMS[kind].package}"):
        open_radio(settings, 148e6)
    with pytest.raises(RadioMissing, match=f"sudo apt install {PROGRAMS[kind].package}"):
        check_device(settings)


def test_a_radio_that_works_is_described_by_its_rate(install: Install) -> None:
    install("airspy_rx", PACED)
    assert check_device(RadioSettings()) == "Airspy: 3000000 samples a second arrive"


@pytest.mark.parametrize(
    ("kind", "words", "error", "remedy"),
    [
        ("airspy", "airspy_open() failed: AIRSPY_ERROR_NOT_FOUND (-5)", RadioMissing, "Plug"),
        ("airspyhf", "airspyhf_open() failed", RadioMissing, "Plug"),
        ("rtlsdr", "No supported devices found.", RadioMissing, "Plug"),
        ("rtlsdr", "usb_claim_interface error -6", RadioMissing, "program that uses"),
        ("rtlsdr", "usb_open error -3", RadioMissing, "plugdev"),
        ("hackrf", "hackrf_open() failed: HackRF not found (-5)", RadioMissing, "Plug"),
        ("airspy", "airspy_set_samplerate() failed", RadioStopped, "sample_rate_hz"),
        ("airspy", "Exiting...", RadioStopped, "cable"),
    ],
)
def test_the_end_of_a_program_is_reported_with_its_last_words(
    install: Install, kind: str, words: str, error: type[Exception], remedy: str
) -> None:
    install("rtl_biast", "")
    # hackrf_transfer prints its usage on stdout when it fails; that must not become samples.
    install(PROGRAMS[kind].receive, f"print('Usage' * 300); sys.exit({words!r})")
    settings = RadioSettings(kind=kind, sample_rate_hz=PROGRAMS[kind].rates_hz[0][0])
    source = ProgramSource(settings, 148e6)
    with pytest.raises(error, match=remedy) as caught:
        source.read(timeout_s=30.0)
    assert isinstance(source, ProgramSource)
    assert words in source.last_lines
    assert (
        caught.type is not RadioStopped or remedy != "cable" or "status 1" in str(caught.value)
    )
    source.close()


def test_a_program_that_was_killed_is_reported_by_its_signal(install: Install) -> None:
    install("airspy_rx", "os.write(1, bytes(3 * 8 * 262144)); os.kill(os.getpid(), 9)")
    source = open_radio(RadioSettings(), 148e6)
    for _ in range(3):
        assert source.read(timeout_s=30.0) is not None
    with pytest.raises(RadioStopped, match="SIGKILL"):
        source.read(timeout_s=30.0)
    source.close()


def test_a_program_that_gives_nothing_is_called_stalled(install: Install) -> None:
    install(
        "airspy_rx", "sys.stderr.write('usb hiccup\\n'); sys.stderr.flush(); time.sleep(60)"
    )
    source = ProgramSource(RadioSettings(), 148e6, startup_s=0.3)
    begun_s = monotonic_s()
    with pytest.raises(RadioStalled, match="no samples arrive"):
        source.read()
    assert monotonic_s() - begun_s >= 0.3
    assert not gone(source.pid)
    source.close()
    assert gone(source.pid)


def test_a_stall_after_samples_is_noticed_too(install: Install) -> None:
    install("airspy_rx", "os.write(1, bytes(8 * 262144)); time.sleep(60)")
    source = ProgramSource(RadioSettings(), 148e6, startup_s=30.0, stall_s=0.2)
    assert source.read() is not None
    with pytest.raises(RadioStalled):
        source.read()
    source.close()


def test_a_program_that_ignores_sigterm_is_killed_with_its_children(install: Install) -> None:
    install(
        "airspy_rx",
        """
        import signal
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        child = os.fork()
        if child:
            sys.stderr.write(f"child {child}\\n"); sys.stderr.flush()
        os.write(1, bytes(8 * 262144))
        time.sleep(60)
        """,
    )
    source = ProgramSource(RadioSettings(), 148e6)
    while not source.last_lines:
        source.read(timeout_s=0.2)
    child = int(source.last_lines[0].split()[1])
    source.close()
    source.close()
    assert gone(source.pid)
    until(lambda: not is_alive(child))  # whoever is process 1 reaps it
    with pytest.raises(EOFError):
        source.read()


def test_samples_that_a_program_says_it_lost_are_a_gap_in_the_stream(install: Install) -> None:
    install(
        "airspy_rx",
        """
        os.write(1, bytes(8 * 262144))
        sys.stderr.write("4000 samples dropped: the reader is too slow\\n"); sys.stderr.flush()
        while True:
            os.write(1, bytes(8 * 262144))
        """,
    )
    source = ProgramSource(RadioSettings(), 148e6)
    seen: list[tuple[int, int]] = []
    while not any(lost for _, lost in seen):
        block = some(source.read(timeout_s=30.0))
        seen.append((block.sample_index, block.lost_before))
    source.close()
    gaps = [lost for _, lost in seen]
    assert sum(gaps) == 4000 == source.samples_lost
    at = gaps.index(4000)
    assert [index for index, _ in seen] == [
        262144 * n + (4000 if n >= at else 0) for n in range(at + 1)
    ]


@pytest.mark.parametrize("known", [True, False])
def test_a_hackrf_program_that_can_is_asked_for_its_overruns(
    install: Install, known: bool
) -> None:
    # Usage and statistics line of hackrf_transfer 2023.01.1; older ones refuse -B.
    install(
        "hackrf_transfer",
        f"""
        if sys.argv[1:] == ["-h"]:
            print("\t[-B] # Print buffer statistics during transfer" if {known} else "Usage:")
            sys.exit(0)
        if ("-B" in sys.argv) != {known}:
            sys.exit("wrong arguments")
        if {known}:
            sys.stderr.write("12.1 MiB / 1.000 sec = 12.1 MiB/second, amplitude -20.0 dBfs, "
                             "16384 bytes free in buffer, 2 overruns, longest 16384 bytes\\n")
            sys.stderr.flush()
        time.sleep(0.1)
        while True:
            os.write(1, bytes(2 * 262144))
        """,
    )
    source = ProgramSource(RadioSettings(kind="hackrf", sample_rate_hz=6e6), 148e6)
    assert source.read(timeout_s=30.0) is not None
    while known and not source.overruns:  # its words are read with the samples
        source.read(timeout_s=30.0)
    source.close()
    assert source.overruns == (2 if known else 0)


def test_much_talk_on_stderr_does_not_stop_the_samples(install: Install) -> None:
    install(
        "airspy_rx",
        """
        for _ in range(20):
            sys.stderr.write("Streaming at 3.000 MSPS\\n" * 5000)
            sys.stderr.flush()
            os.write(1, bytes(8 * 262144))
        """,
    )
    source = ProgramSource(RadioSettings(), 148e6)
    for _ in range(20):
        assert source.read(timeout_s=30.0) is not None
    with pytest.raises(RadioStopped, match="status 0"):
        source.read(timeout_s=30.0)
    assert source.last_lines == ()
    source.close()


@pytest.mark.parametrize(
    ("settings", "remedy"),
    [
        (RadioSettings(gain=22), "between 0 and 21"),
        (RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, gain=-1), "between 1 and 50"),
        (RadioSettings(kind="rtlsdr", sample_rate_hz=6e6), "sample_rate_hz"),
        (RadioSettings(kind="airspyhf", sample_rate_hz=768e3, bias_tee=True), "bias_tee"),
        (RadioSettings(kind="nosuch"), "kind"),
    ],
)
def test_settings_that_a_radio_does_not_have_are_refused(
    settings: RadioSettings, remedy: str
) -> None:
    with pytest.raises(ConfigError, match=remedy):
        receive_command(settings, 148e6)
