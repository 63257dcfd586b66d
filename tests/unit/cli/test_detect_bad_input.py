"""Whatever is wrong with what `uavrt detect` is given: one line with the remedy, status 2."""

from pathlib import Path

import numpy as np
import pytest
from command_line import Ran
from sigmf_meta import write_meta

TAG = "2, 148710000, 1254, 20, 60, 10, 3, 0.005\n"
RADIO = ("--sample-rate", "250e3", "--center-frequency", "148.7e6")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(2 * 500_000).astype("<f4") * 0.01
    (tmp_path / "a.cf32").write_bytes(noise.tobytes())
    (tmp_path / "a.cs16").write_bytes((noise * 32768).astype("<i2").tobytes())
    (tmp_path / "cut.cf32").write_bytes(noise.tobytes()[:-3])
    (tmp_path / "full.csv").symlink_to("/dev/full")
    (tmp_path / "absurd.cf32").write_bytes(rng.bytes(100_000))
    (tmp_path / "empty.cf32").write_bytes(b"")
    (tmp_path / "bad.sigmf-meta").write_text("{]")
    (tmp_path / "bad.wav").write_bytes(b"RIFF")
    (tmp_path / "tags.txt").write_text(TAG)
    (tmp_path / "far.txt").write_text(TAG.replace("2, 148710", "4, 151710"))
    (tmp_path / "bad.txt").write_text(
        TAG.replace("1254", "-3") + "x\n" + TAG.replace("20", "nan")
    )
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "remedy"),
    [
        (("nowhere.cf32", "--tags", "tags.txt", *RADIO), "Check the path"),
        ((".", "--tags", "tags.txt", *RADIO, "--format", "cf32"), "directory"),
        (("a.cf32", *RADIO), "--tags"),
        (("a.cf32", "--tags", "none.txt", *RADIO), "none.txt"),
        (("a.cf32", "--tags", "bad.txt", *RADIO), "Correct these lines"),
        (("a.cf32", "--tags", "far.txt", *RADIO), "151.71"),
        (("a.cf32", "--tags", "tags.txt"), "--sample-rate"),
        (("a.cf32", "--tags", "tags.txt", "--sample-rate", "250e3"), "--center-frequency"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--format", "mp3"), "--format"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--sample-rate", "-1"), "--sample-rate"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--sample-rate", "nan"), "--sample-rate"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--sample-rate", "10"), "sample"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--start-time", "noon"), "2024-05-01T06"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--frequency-window", "0"), "window"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--frequency-window", "nan"), "window"),
        (("a.cs16", "--tags", "tags.txt", *RADIO, "--format", "cf32"), "--format"),
        (("empty.cf32", "--tags", "tags.txt", *RADIO), "no samples"),
        (("cut.cf32", "--tags", "tags.txt", *RADIO), "truncated"),
        (("bad.sigmf-meta", "--tags", "tags.txt"), "JSON"),
        (("bad.wav", "--tags", "tags.txt"), "not a WAV"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "-o", "no/such/p.csv"), "mkdir -p"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "-o", "a.cf32"), "another name"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "-o", "full.csv"), "Free space"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "-o", "tags.txt"), "another name"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "-o", "p.xlsx"), ".csv"),
        (("absurd.cf32", "--tags", "tags.txt", *RADIO), "far too large"),
        (("none.cf32", "--tags", "tags.txt"), "Check the path"),
        (("a.cf32", "--tags", "tags.txt", *RADIO, "--start-time", "2300-01-01"), "2261"),
        (("udp://192.0.2.1:20000", "--tags", "tags.txt", *RADIO), "of this computer"),
        (("a.cf32", "--flight", "."), "flight.sqlite"),
    ],
)
def test_bad_input_is_refused_with_the_remedy(
    folder: Path, ran: Ran, arguments: tuple[str, ...], remedy: str
) -> None:
    # A later --sample-rate stands for the one in RADIO.
    if arguments.count("--sample-rate") == 2:
        first = arguments.index("--sample-rate")
        arguments = arguments[:first] + arguments[first + 2 :]
    said = ran("detect", *arguments, ends=2).err
    assert remedy in said
    assert "Traceback" not in said


def test_all_tags_outside_the_span_are_listed_with_the_span(folder: Path, ran: Ran) -> None:
    far = TAG.replace("2, 148710", "4, 151710") + TAG.replace("2, 148710", "6, 145710")
    (folder / "far.txt").write_text(far)
    said = ran("detect", "a.cf32", "--tags", "far.txt", *RADIO, ends=2).err
    assert "151.710000, 145.710000 MHz outside the usable span" in said
    # With one of them inside, that one is searched.
    (folder / "far.txt").write_text(TAG + far)
    said = ran("detect", "a.cf32", "--tags", "far.txt", *RADIO).err
    assert "tag 4 at 151.710000 MHz is outside of this recording's band" in said
    assert "tag 6 at 145.710000 MHz is outside of this recording's band" in said
    assert "tag 2: 0 pulses" in said


def test_what_was_found_before_a_truncated_end_is_written(folder: Path, ran: Ran) -> None:
    rate, seconds = 250_000, 10
    t = np.arange(rate * seconds) / rate
    rng = np.random.default_rng(2)
    x = 0.01 * rng.standard_normal((t.size, 2)).view(complex)[:, 0]
    x += 0.004 * ((t % 1.254) < 0.020) * np.exp(2j * np.pi * 10e3 * t)
    (folder / "b.cf32").write_bytes(x.astype(np.complex64).tobytes() + b"abc")
    assert (
        "truncated"
        in ran("detect", "b.cf32", "--tags", "tags.txt", *RADIO, "-o", "p.csv", ends=2).err
    )
    assert len((folder / "p.csv").read_text().splitlines()) >= 7


def test_an_unwritable_place_is_named_before_the_work(folder: Path, ran: Ran) -> None:
    (folder / "there").mkdir()
    said = ran("detect", "a.cf32", "--tags", "tags.txt", *RADIO, "-o", "there", ends=2).err
    assert "cannot write there" in said
    assert "real time" not in said


@pytest.mark.parametrize("output", ["rec.sigmf-data", "rec.sigmf-meta", "tags.txt", "link"])
def test_no_output_empties_what_is_read(folder: Path, ran: Ran, output: str) -> None:
    (folder / "a.cf32").rename(folder / "rec.sigmf-data")
    write_meta(folder / "rec", 250e3, {"frequency": 148.7e6})
    (folder / "link").symlink_to("rec.sigmf-data")
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert (
        "another name"
        in ran("detect", "rec.sigmf-meta", "--tags", "tags.txt", "-o", output, ends=2).err
    )
    assert all((folder / name).read_bytes() == content for name, content in before.items())
