"""The demo: its worlds and programs, what it shows, counts and leaves on the computer."""

import fcntl
import io
import os
import socket
import tempfile
from dataclasses import replace
from pathlib import Path

import made
import pytest
from command_line import Ran
from rich.console import Console
from some import some

from uavrt.core.errors import UavrtError, UsageError
from uavrt.core.messages import SearchNote, SoughtTag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.link.ros2.network.dds import reach_of
from uavrt.simulation.demo.demo_programs import demo_environment, free_ros_domain
from uavrt.simulation.demo.demo_search import SearchSummary, SoughtAnimal
from uavrt.simulation.demo.summary import sampled_span, summarize_tag, true_bursts
from uavrt.simulation.demo.telling import in_plain_words
from uavrt.simulation.demo.view import DemoView, TagView
from uavrt.simulation.demo.watch import samples_lost
from uavrt.simulation.demo.workplace import LOCK, sweep, workplace
from uavrt.simulation.demo.worlds import flight_world, search_world
from uavrt.simulation.scene.demo_world import demo_scenario, search_scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.scene.world import World

PROCESSES = ("receiver", "detector-1", "connection", "recorder", "supervisor", "ros2")


def flown_view() -> DemoView:
    world = demo_scenario(120.0, coded=True)
    tags = {tag.tag_id: TagView(tag) for tag in world.tags}
    for view in tags.values():
        for number in range(30):
            time_ns = 1_700_000_000_000_000_000 + number
            view.add(made.pulse(time_ns, tag_id=view.tag.tag_id, snr_db=31.4), 100.0)
    processes = tuple(
        made.process_status(
            name,
            "running",
            pid=12,
            cpu_s=3.0,
            memory_mb=81.0,
            counters={"samples_lost": 7.0, "channel_samples_dropped": 2.0},
        )
        for name in PROCESSES
    )
    status = made.system_status(
        1, center_frequency_hz=148.6e6, flight_directory="f", processes=processes
    )
    more = ("radio (simulated)", "autopilot (simulated)", "ground", "demo's view")
    return DemoView(
        duration_s=120.0,
        tags=tags,
        status=status,
        elapsed_s=61.0,
        phase="flying to point 2",
        cpu_percent=dict.fromkeys((*PROCESSES, *more), 3.2),
        page_address="http://127.0.0.1:43213/",
        ros_domain=42,
    )


def shown(what: object, width: int) -> list[str]:
    console = Console(width=width, file=io.StringIO())
    console.print(what)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_a_terminal_of_80_columns_and_24_rows_shows_all_of_a_flight() -> None:
    view = flown_view()
    lines = shown(view.render(101.0), 80)
    assert len(lines) <= 23
    text = "\n".join(lines)
    assert "…" not in text
    for name in (*PROCESSES, "ground", "demo's view"):
        assert name in text
    for tag in view.tags.values():
        (line,) = [one for one in lines if f" {tag.tag.tag_id} {tag.tag.name} " in one]
        assert "31.4" in line
        assert "148.71000" in line


def test_a_wide_terminal_has_bars_and_units() -> None:
    text = "\n".join(shown(flown_view().render(101.0), 120))
    assert "█" in text
    assert "148.71000 MHz" in text
    assert "real receiver" in text


def test_losses_are_counted_once_and_alike_in_view_and_table() -> None:
    view = flown_view()
    counters = some(view.status).processes[0].counters
    assert samples_lost(counters) == 9
    assert " lost 9 " in shown(view.render(101.0), 80)[1]
    assert "samples lost 9 " in shown(view.render(101.0), 120)[1]


def animal(name: str, *, found: bool) -> SoughtAnimal:
    return SoughtAnimal(
        name=name,
        found=found,
        found_s=123.4 if found else None,
        error_m=12.3 if found else None,
        radius95_m=21.0,
        walked_m=45.0,
        pulses=123,
        latitude_deg=-46.123456,
        longitude_deg=-108.123456,
    )


def test_the_result_of_a_search_fits_80_columns_and_says_how_many_were_found() -> None:
    summary = SearchSummary(
        tags={"2": animal("lynx", found=True), "14": animal("wandering fox", found=False)},
        ended="returning: the autopilot flies home",
        duration_s=284.0,
        decisions=30,
        commands=25,
        guide_cpu_percent=1.0,
        guide_memory_mb=80.0,
        flight_directory="f",
    )
    lines = shown(summary.table(), 80)
    assert "1 of 2 animals found after 284 s" in lines[0]
    text = "\n".join(lines)
    assert "…" not in text
    assert any("2 lynx" in line and "-46.12346, -108.12346" in line for line in lines)
    assert any("14 wandering fox" in line for line in lines)


@pytest.mark.parametrize(
    ("event", "text", "reason", "told"),
    [
        (
            "decision",
            "turn by 360° in 20 s",
            "to locate tag 4, which may be near, first",
            "turn once in place: to locate tag 4, which may be near, first",
        ),
        (
            "decision",
            "fly 120 m north-east",
            "to learn more about tag 4",
            "fly 120 m north-east: to learn more about tag 4",
        ),
        ("found", "tag 4 found", "95 % within 21 m; bias +2.6 σ, scatter × 0.3", "21 m (95 %)"),
        ("ended", "3 of 3 found", "returning: the autopilot flies home", "3 of 3 found"),
    ],
)
def test_a_search_tells_what_it_does_and_why_without_figures_of_its_own(
    event: str, text: str, reason: str, told: str
) -> None:
    note = SearchNote(
        time_ns=1,
        order_id=1,
        event=event,  # type: ignore[arg-type]
        text=text,
        reason=reason,
        elapsed_s=75.0,
        latitude_deg=46.0,
        longitude_deg=8.0,
        height_m=40.0,
        battery_percent=80.0,
        tags=(
            SoughtTag(
                tag_id=4,
                latitude_deg=46.0,
                longitude_deg=8.0,
                radius95_m=21.0,
                existence=1.0,
                found_s=75.0,
                pulses=40,
                missed=2,
            ),
        ),
        tag_id=4 if event == "found" else None,
    )
    line = in_plain_words(note)
    assert line.startswith(" 1:15 ")
    assert line.endswith(told)
    assert not {"nats", "σ", "candidates"} & set(line.split())


@pytest.mark.parametrize("more", ["", " --drones 2"])
def test_a_port_that_is_taken_is_told_before_anything_starts(
    tmp_path: Path, ran: Ran, more: str
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        line = f"demo --no-browser --port {port} --flight-dir {tmp_path}{more}"
        said = ran(*line.split(), ends=2).err
    assert f"port {port}: Address already in use" in said
    assert "--port" in said


def test_what_a_killed_demo_left_is_swept_by_the_next_and_a_running_one_s_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for name in ("uavrt-demo-dead", "uavrt-search-dead", "uavrt-demo-live", "another"):
        (tmp_path / name).mkdir()
        (tmp_path / name / LOCK).touch()
    old = tmp_path / "uavrt-demo-old"
    old.mkdir()
    os.utime(old, (1e9, 1e9))
    with (tmp_path / "uavrt-demo-live" / LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with workplace("uavrt-demo-") as place:
            (place / "ground.log").write_text("hears nothing")
            sweep(tmp_path)
            left = {one.name for one in tmp_path.iterdir()}
            assert left == {"uavrt-demo-live", "another", place.name}
    assert not place.exists()


def test_the_log_files_of_a_demo_that_failed_stay_to_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(UavrtError), workplace("uavrt-demo-") as place:
        raise UavrtError("detection did not start")
    assert place.is_dir()
    with pytest.raises(KeyboardInterrupt), workplace("uavrt-demo-") as another:
        raise KeyboardInterrupt
    assert not place.exists()
    assert not another.exists()


GIVEN = demo_scenario(60.0, 7, coded=True)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_scenario(GIVEN, tmp_path / "world.toml")
    return tmp_path / "world.toml"


def test_a_scenario_file_is_flown_as_it_is_unless_told_otherwise(file: Path) -> None:
    assert flight_world(file, duration_s=None, seed=None, coded=False) == GIVEN
    changed = flight_world(file, duration_s=25.0, seed=3, coded=False)
    assert changed == replace(GIVEN, duration_s=25.0, seed=3)
    built_in = flight_world(None, duration_s=None, seed=None, coded=True)
    assert built_in == demo_scenario(120.0, 1, coded=True)
    assert [tag.tag_id for tag in built_in.tags if tag.coded] == [12, 14]


def test_a_search_hovers_over_the_files_home(file: Path) -> None:
    world = search_world(file, limit_s=600.0, seed=None, coded=False)
    assert (world.tag, world.flight.leg) == (GIVEN.tag, ())
    assert world.duration_s > 600.0
    built_in = search_world(None, limit_s=600.0, seed=None, coded=True)
    assert built_in == search_scenario(1, coded=True)
    assert sum(tag.coded for tag in built_in.tags) == 2


def test_worlds_that_show_nothing_are_refused(file: Path) -> None:
    with pytest.raises(UsageError, match="--coded works only with the built-in world"):
        flight_world(file, duration_s=None, seed=None, coded=True)
    with pytest.raises(UsageError, match="at least 20 s"):
        flight_world(file, duration_s=5.0, seed=None, coded=False)
    far = tuple(replace(tag, north_m=400.0) for tag in GIVEN.tag)
    write_scenario(replace(GIVEN, tag=far), file)
    with pytest.raises(UsageError, match="tag 2 is 410 m from home"):
        search_world(file, limit_s=60.0, seed=None, coded=False)
    write_scenario(replace(GIVEN, tag=()), file)
    with pytest.raises(UsageError, match="no tag to search for"):
        flight_world(file, duration_s=None, seed=None, coded=False)


def test_bursts_that_were_sent_are_counted_whole() -> None:
    robin = next(tag for tag in GIVEN.tag if tag.tag_id == 12)
    begin_ns = GIVEN.start_time_ns + 430_000_000  # within its first burst
    sent = World(GIVEN).truth(begin_ns, begin_ns + 10_000_000_000)
    own = [pulse for pulse in sent if pulse.tag_id == 12]
    assert len(own) == 2 + 4 * 4
    bursts = true_bursts(own, 4)
    starts_s = [1e-9 * (one.start_time_ns - GIVEN.start_time_ns) for one in bursts]
    assert starts_s == pytest.approx([2.7, 5.0, 7.3, 9.6], abs=2e-3)
    for burst in bursts:
        length_s = 1e-9 * (burst.end_time_ns - burst.start_time_ns)
        assert length_s == pytest.approx(robin.tag.length_s, abs=1e-4)


def test_the_demo_s_ros_domain_is_nobody_s(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    domains = {free_ros_domain() for _ in range(300)}
    assert len(domains) > 50
    assert not domains & {0, 42}


def test_a_domain_that_somebody_uses_is_not_taken() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        taken = free_ros_domain()
        sock.bind(("127.0.0.1", 7400 + 250 * taken + 10))
        assert taken not in {free_ros_domain() for _ in range(300)}


def test_no_setting_of_the_site_takes_the_demo_off_the_loopback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "file:///etc/site.xml")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    environment = demo_environment()
    assert "CYCLONEDDS_URI" not in environment
    assert reach_of(environment) == "computer"
    assert environment["PATH"]


def test_pulses_before_the_first_reported_sample_are_not_false() -> None:
    scenario = demo_scenario(60.0)
    world, begin_ns = World(scenario), scenario.start_time_ns
    end_ns = begin_ns + 60 * NANOSECONDS_PER_SECOND
    recorded = [
        made.pulse(one.start_time_ns + 1000, tag_id=one.tag_id, frequency_hz=one.frequency_hz)
        for one in world.truth(begin_ns, end_ns)
    ]
    reported = (begin_ns + 20 * NANOSECONDS_PER_SECOND, end_ns - 9 * NANOSECONDS_PER_SECOND)
    truth = world.truth(*sampled_span(*reported, recorded))
    for tag in scenario.tags:
        found = summarize_tag(tag, truth, recorded, [])
        assert (found.false, found.detected) == (0, found.transmitted)
        assert found.transmitted > 30
    assert sampled_span(*reported, []) == reported
