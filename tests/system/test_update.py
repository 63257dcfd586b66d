"""``uavrt update``: whose files are taken, when, and that a version runs after every cut."""

import itertools
import os
import random
import shutil
import signal
import subprocess
import tarfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import made
import pytest
from command_line import started, uavrt
from forked import forked
from hypothesis import given, settings
from hypothesis import strategies as st
from some import some
from update_maker import (
    TINY,
    digest_below,
    make_installation,
    make_key,
    sign_alone,
    write_update,
    write_wheel,
)

from uavrt.core.commands import SystemState
from uavrt.core.errors import FormatError, UavrtError, UsageError
from uavrt.core.messages import Poses, SystemStatus
from uavrt.drone.computer import update
from uavrt.drone.computer.trial import ARMED, Needs, Seen, Trial, Verdict, require_still
from uavrt.drone.computer.update_file import read_update, unpack_wheels, version_key
from uavrt.drone.computer.versions import Installation

ALL = Needs(heartbeat=True, poses=True)


@dataclass
class Maker:
    """Keys and updates of one test run."""

    directory: Path
    key: Path
    public: str
    other_key: Path
    other_public: str

    def tar(self, version: str, *, key: Path | None = None, keys: str | None = None) -> Path:
        wheel = write_wheel(self.directory, version, TINY)
        listed = None
        if keys is not None:
            listed = self.directory / "new-keys.pem"
            listed.write_text(keys)
        output = self.directory / f"uavrt-{version}.tar"
        return write_update(output, wheel, key or self.key, listed)

    def keys(self) -> Path:
        path = self.directory / "keys.pem"
        path.write_text(self.public)
        path.chmod(0o644)
        return path


@pytest.fixture(scope="module")
def maker(tmp_path_factory: pytest.TempPathFactory) -> Maker:
    directory = tmp_path_factory.mktemp("maker")
    return Maker(directory, *make_key(directory, "one"), *make_key(directory, "two"))


@pytest.fixture(scope="module")
def installed(maker: Maker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    prefix = tmp_path_factory.mktemp("installed") / "opt"
    make_installation(prefix, write_wheel(maker.directory, "0.1.0", TINY), maker.public)
    return prefix


@pytest.fixture
def place(installed: Path, tmp_path: Path) -> Installation:
    return Installation(shutil.copytree(installed, tmp_path / "opt", symlinks=True))


# ------------------------------------------------------------------ the file


def test_no_truncated_or_changed_file_is_ever_taken(maker: Maker, tmp_path: Path) -> None:
    """Wherever it ends and whichever byte is wrong: an error with a remedy."""
    whole, keys = maker.tar("0.2.0"), maker.keys()
    content = whole.read_bytes()
    found = read_update(whole, keys)
    assert (found.version, found.alone) == ("0.2.0", False)
    rng = random.Random(19)
    end = content.rindex(b"PK\x05\x06") + 22  # of the wheel; after it the archive is padding
    broken = [content[: rng.randrange(end)] for _ in range(25)]
    inside = content.index(b"PK\x03\x04")  # the wheel begins here; before it the manifest
    for position in [rng.randrange(inside) for _ in range(25)] + [
        rng.randrange(inside, inside + 400) for _ in range(15)
    ]:
        byte = bytes((content[position] ^ (1 << rng.randrange(8)),))
        broken.append(content[:position] + byte + content[position + 1 :])
    refused = 0
    for number, wrong in enumerate(broken):
        path = tmp_path / "wrong.tar"
        path.write_bytes(wrong)
        target = tmp_path / f"wheels-{number}"
        target.mkdir()
        error: UavrtError | None = None
        try:
            unpack_wheels(read_update(path, keys), target)
        except UavrtError as caught:
            error = caught
        if error is not None:
            assert error.remedy
            refused += 1
        else:  # padding of the archive, which says nothing
            (wheel,) = target.iterdir()
            assert wheel.read_bytes() in content
    assert refused > 45


@pytest.mark.parametrize(
    ("size", "kind"),
    [
        (b"\x80" + b"\xff" * 11, b"0"),
        (b"\x80" + bytes(5) + b"\x7f" + bytes(5), b"x"),
        (b"77777777777\0", b"L"),
        (b"00000000000\0", b"S"),
        (b"\xff" * 12, b"0"),
        (b"  no number ", b"0"),
    ],
)
def test_headers_that_cannot_be_are_refused_before_anything_is_read(
    maker: Maker, tmp_path: Path, size: bytes, kind: bytes
) -> None:
    content = bytearray(maker.tar("0.2.0").read_bytes())
    content[124:136], content[156:157], content[148:156] = size, kind, b" " * 8
    content[148:156] = b"%06o\0 " % sum(content[:512])
    path = tmp_path / "wrong.tar"
    path.write_bytes(content)
    with pytest.raises(FormatError, match="not an update, or is damaged"):
        read_update(path, maker.keys())


def test_no_extended_header_tells_another_size(maker: Maker, tmp_path: Path) -> None:
    told = tarfile.TarInfo("update.json")
    told.pax_headers = {"size": "9" * 25}
    path = tmp_path / "wrong.tar"
    path.write_bytes(told.tobuf(tarfile.PAX_FORMAT) + maker.tar("0.2.0").read_bytes())
    with pytest.raises(FormatError, match="tar format is not supported"):
        read_update(path, maker.keys())


def test_a_signature_of_any_length_is_not_read_whole(maker: Maker, tmp_path: Path) -> None:
    wheel = write_wheel(tmp_path, "0.2.0", TINY)
    with open(f"{wheel}.sig", "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(FormatError, match="too large"):
        read_update(wheel, maker.keys())


def test_only_listed_keys_count_and_only_their_owner_may_change_them(maker: Maker) -> None:
    keys = maker.keys()
    with pytest.raises(UsageError, match="not signed with an accepted key"):
        read_update(maker.tar("0.2.0", key=maker.other_key), keys)
    keys.write_text(maker.other_public + maker.public)
    assert read_update(maker.tar("0.2.0"), keys).version == "0.2.0"
    keys.chmod(0o666)
    with pytest.raises(UsageError, match="users other than root can write"):
        read_update(maker.tar("0.2.0"), keys)
    keys.write_text("")
    keys.chmod(0o644)
    with pytest.raises(UsageError, match="no key in"):
        read_update(maker.tar("0.2.0"), keys)
    keys.unlink()
    with pytest.raises(UsageError, match="no accepted keys"):
        read_update(maker.tar("0.2.0"), keys)


def test_a_wheel_alone_needs_its_signature_beside_it(maker: Maker, tmp_path: Path) -> None:
    keys = maker.keys()
    wheel = write_wheel(tmp_path, "0.2.0", TINY)
    with pytest.raises(UsageError, match=r"there is no .*\.sig"):
        read_update(wheel, keys)
    sign_alone(wheel, maker.key)
    assert read_update(wheel, keys).alone
    wheel.write_bytes(wheel.read_bytes() + b"\0")
    with pytest.raises(UsageError, match="not signed"):
        read_update(wheel, keys)


def test_what_is_installed_is_what_was_signed_whatever_becomes_of_the_file(
    maker: Maker, place: Installation, tmp_path: Path
) -> None:
    wheel = write_wheel(tmp_path, "0.2.0", TINY)
    sign_alone(wheel, maker.key)
    found = read_update(wheel, place.keys)
    write_wheel(tmp_path, "0.2.0", {**TINY, "uavrt/__init__.py": "raise SystemExit('other')\n"})
    made = update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    installed = next(made.glob("lib/python3*/site-packages/uavrt/__init__.py"))
    assert "other" not in installed.read_text()


@given(st.lists(st.tuples(*[st.integers(0, 30)] * 3), min_size=2, max_size=2), st.data())
def test_versions_are_ordered_as_packaging_orders_them(
    numbers: list[tuple[int, int, int]], data: st.DataObject
) -> None:
    from packaging.version import Version

    tails = st.sampled_from(["", "a1", "b2", "rc1", "rc10", ".dev3", ".post1", "a1.dev2", ".0"])
    one, two = (".".join(map(str, n)) + data.draw(tails) for n in numbers)
    assert (version_key(one) < version_key(two)) == (Version(one) < Version(two))
    assert (version_key(one) == version_key(two)) == (Version(one) == Version(two))


# ------------------------------------------------------- when it is refused, and judged


def system(
    *,
    status: str = "ready",
    armed: bool | None = False,
    restarts: int = 0,
    state: SystemState = SystemState.IDLE,
) -> SystemStatus:
    counters = {} if armed is None else {ARMED: float(armed)}
    connection = made.process_status(
        "connection", status, restarts=restarts, memory_mb=1.0, counters=counters
    )
    return made.system_status(state=state, processes=(connection,))


def seen(*records: object) -> Seen:
    made = Seen()
    for record in records:
        made.add(record, 0.0)
    return made


POSES = Poses(poses=())


@pytest.mark.parametrize(
    ("records", "bench", "says"),
    [
        ([system(armed=True), POSES], False, "armed"),
        ([system(armed=True), POSES], True, "armed"),
        ([system(state=SystemState.DETECTING), POSES], True, "a flight is being recorded"),
        ([system(status="waiting for autopilot", armed=None)], False, "may be armed"),
        ([system()], False, "no poses"),
        ([], False, "may be armed"),
    ],
)
def test_it_is_refused_where_it_could_bring_down_a_drone(
    records: list[object], bench: bool, says: str
) -> None:
    with pytest.raises(UsageError, match=says) as caught:
        require_still(seen(*records), ALL, 1.0, bench=bench)
    assert caught.value.remedy


def test_on_a_bench_only_what_is_there_is_asked_for() -> None:
    assert require_still(seen(system(), POSES), ALL, 1.0, bench=False) == ALL
    roof = require_still(seen(system()), ALL, 1.0, bench=True)
    assert roof == Needs(heartbeat=True, poses=False)
    alone = require_still(seen(system(armed=None, status="x")), ALL, 1.0, bench=True)
    assert alone == Needs(heartbeat=False, poses=False)


@settings(max_examples=60)
@given(st.data())
def test_a_version_is_taken_after_a_minute_without_a_gap_and_only_then(
    data: st.DataObject,
) -> None:
    """Whatever fails, and when: good means that the last minute was whole; armed never bad."""
    trial = Trial(ALL, 0.0)
    faults = data.draw(
        st.lists(
            st.tuples(
                st.sampled_from(["nothing", "no poses", "no heartbeat", "restart", "armed"]),
                st.integers(0, 200),
                st.integers(6, 120),
            ),
            max_size=4,
        )
    )
    restarts, absent_s, whole_s, verdict = 0, 0, 0, Verdict.OPEN
    for second in range(600):
        now = {name for name, begin, length in faults if begin <= second < begin + length}
        restarts += "restart" in now
        records: list[object] = []
        if "nothing" not in now:
            status = "waiting for autopilot" if "no heartbeat" in now else "ready"
            armed = None if "no heartbeat" in now else "armed" in now
            records.append(system(status=status, armed=armed, restarts=restarts))
            records += [] if "no poses" in now else [POSES]
        absent_s = absent_s + 1 if now - {"armed"} else 0
        # Five seconds of silence are no gap; one restart is.
        whole_s = 0 if absent_s > 5 or "restart" in now else whole_s + 1
        verdict = trial.judge(records, float(second))
        if verdict is not Verdict.OPEN:
            break
    if verdict is Verdict.GOOD:
        assert whole_s >= 60
    else:
        assert verdict is Verdict.BAD
        # Who says nothing is not heard to be armed.
        assert "armed" not in now or now & {"nothing", "no heartbeat"}
        assert whole_s < 60
    assert faults or (verdict is Verdict.GOOD and second == 60)


@pytest.mark.parametrize("period_s", [2, 5, 50])
def test_a_version_whose_process_dies_again_and_again_is_not_tried_for_ever(
    period_s: int,
) -> None:
    trial = Trial(ALL, 0.0)
    for second in range(600):
        records = [system(restarts=second // period_s), POSES]
        verdict = trial.judge(records, float(second))
        if verdict is not Verdict.OPEN:
            break
    assert verdict is Verdict.BAD
    assert 180 < second <= 180 + period_s
    assert "had to be restarted" in trial.fault


@pytest.mark.parametrize("silent", ["the service", "the autopilot"])
def test_a_version_that_falls_silent_when_armed_does_not_stay_for_ever(silent: str) -> None:
    """The last word was "armed": the battery was taken out, or the version is dead."""
    trial = Trial(ALL, 0.0)
    for second in range(600):
        records: list[object] = [system(armed=True)] if second <= 100 else []
        if second > 100 and silent == "the autopilot":
            records = [system(status="waiting for autopilot", armed=None)]
        verdict = trial.judge(records, float(second))
        if verdict is not Verdict.OPEN:
            break
    assert verdict is Verdict.BAD
    assert 100 + 180 < second <= 100 + 180 + 6


# ----------------------------------------------------------------- the installation


def test_a_newer_version_is_made_beside_and_an_older_one_not_unasked(
    maker: Maker, place: Installation, tmp_path: Path
) -> None:
    """The whole way by pip, offline: a new environment, tried, taken; its keys count then."""
    before = digest_below(place.current())
    found = update.check(maker.tar("0.2.0", keys=maker.other_public), place)
    made = update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert digest_below(place.current()) == before
    said: list[str] = []
    restarts: list[str] = []

    def restart() -> None:
        restarts.append(place.current().name)

    assert update.exchange(
        made, place, restart=restart, judge=lambda: (Verdict.GOOD, ""), say=said.append
    )
    assert restarts == [found.name]
    assert place.current() == made
    assert not place.trial.is_symlink()
    asked = [str(place.link / "bin/python"), "-m", "uavrt.cli"]
    ran = subprocess.run(asked, capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "0.2.0"
    assert Installation.of(str(place.link / "bin/python")) == place
    # The new key counts, the one before no longer.
    with pytest.raises(UsageError, match="not signed"):
        update.check(maker.tar("0.3.0"), place)
    older = maker.tar("0.1.5", key=maker.other_key)
    with pytest.raises(UsageError, match="is not newer than") as caught:
        update.check(older, place)
    assert "--downgrade" in str(caught.value)
    assert update.check(older, place, downgrade=True).version == "0.1.5"


def test_a_version_that_does_not_start_is_not_even_tried(
    maker: Maker, place: Installation, tmp_path: Path
) -> None:
    files = TINY | {"uavrt/cli/__main__.py": "import nonsense\n"}
    wheel = sign_alone(write_wheel(tmp_path, "0.2.0", files), maker.key)
    found = update.check(wheel, place)
    with pytest.raises(UsageError, match=r"does not start here: .*nonsense"):
        update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert place.current().name == "source"


def test_a_full_disk_leaves_what_was(
    maker: Maker, place: Installation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = update.check(maker.tar("0.2.0"), place)
    monkeypatch.setattr(update, "SPACE_FACTOR", 1e12)
    with pytest.raises(UsageError, match="Free disk space"):
        update.check(maker.tar("0.2.0"), place)

    def full(*_arguments: object, **_options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(update, "unpack_wheels", full)
    with pytest.raises(UsageError, match="No space left"):
        update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert [path.name for path in (place.prefix / "versions").iterdir()] == ["source"]


class PowerCut(BaseException):
    """Nothing after it happens."""


@contextmanager
def cut_at(monkeypatch: pytest.MonkeyPatch, number: int) -> Iterator[None]:
    """Let the power fail before the file system is changed for the n-th time."""
    count = itertools.count()

    def counted(real: Any) -> Any:
        def operation(*arguments: Any, **options: Any) -> Any:
            if next(count) == number:
                raise PowerCut
            return real(*arguments, **options)

        return operation

    with monkeypatch.context() as patch:
        for name in ("replace", "symlink_to", "unlink", "touch"):
            patch.setattr(Path, name, counted(getattr(Path, name)))
        patch.setattr(os, "fsync", counted(os.fsync))
        patch.setattr(shutil, "rmtree", counted(shutil.rmtree))
        yield


@pytest.mark.parametrize("verdict", [Verdict.GOOD, Verdict.BAD])
def test_after_a_cut_anywhere_a_whole_version_runs_and_the_trial_is_ended(
    tmp_path: Path, verdict: Verdict, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also when the power fails again while that is done at the next boot."""
    ended = set()
    for first, second in itertools.product(range(26), (0, 1, 2, 3, 5, 99)):
        prefix = tmp_path / f"{first}-{second}"
        place = Installation(prefix)
        for name in ("source", "0.2.0-new", "0.0.1-old"):
            (prefix / "versions" / name).mkdir(parents=True)
        (prefix / "versions/0.2.0-new" / update.KEYS).write_text("new")
        place.keys.write_text("old")
        place.link.symlink_to("versions/source")
        made = place.version_directory("0.2.0-new")

        def nothing() -> None:
            assert place.current().is_dir()  # noqa: B023

        def judged() -> tuple[Verdict, str]:
            return verdict, "no poses"

        finished = True
        try:
            with cut_at(monkeypatch, first):
                update.exchange(
                    made, place, restart=nothing, judge=judged, say=lambda _text: None
                )
        except PowerCut:
            finished = False
        assert place.current().is_dir()
        try:
            with cut_at(monkeypatch, second):
                update.finish(place, restart=nothing, judge=judged, say=lambda _text: None)
        except PowerCut:
            assert place.current().is_dir()
            update.finish(place, restart=nothing, judge=judged, say=lambda _text: None)
        assert not place.trial.is_symlink()
        name = place.current().name
        assert place.current().is_dir()
        assert (place.keys.read_text() == "new") == (name == "0.2.0-new")
        ended.add((finished, name))
    if verdict is Verdict.GOOD:
        assert ended == {(True, "0.2.0-new"), (False, "0.2.0-new"), (False, "source")}
    else:
        assert {name for _, name in ended} == {"source"}


def update_that_stands_still(moment: str, directory: Path, words: list[str], told: int) -> None:
    def stall(*_arguments: object, **_options: object) -> None:
        os.write(told, b"there")
        time.sleep(100.0)

    os.setsid()
    os.chdir(directory)
    assert hasattr(update, moment)
    setattr(update, moment, stall)
    uavrt(*words)


def test_killed_while_it_installs_it_leaves_the_present_version_and_can_be_repeated(
    maker: Maker, place: Installation, tmp_path: Path
) -> None:
    (tmp_path / "flights").mkdir()
    (tmp_path / "uavrt.toml").write_text('[mavlink]\naddress = ""\n')
    words = ["update", str(maker.tar("0.2.0")), "--prefix", str(place.prefix)]
    words += ["--restart", "true", "--hold-s", "0.1", "--patience-s", "1"]
    before = digest_below(place.current())
    reading, told = os.pipe()
    for moment in ("unpack_wheels", "rehearse", "exchange"):
        program = forked(update_that_stands_still, moment, tmp_path, words, told)
        assert os.read(reading, 9) == b"there", moment
        os.killpg(some(program.pid), signal.SIGKILL)
        program.join()
        assert place.current().name == "source"
        assert digest_below(place.current()) == before
    for end in (reading, told):
        os.close(end)
    done = started(*words, cwd=tmp_path)
    # Nothing runs here, so the trial ends with the version before.
    assert done.returncode == 1, done.stderr
    assert "source is restored" in done.stdout
    assert place.current().name == "source"
    assert not place.trial.is_symlink()
