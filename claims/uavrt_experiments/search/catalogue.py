"""The tables T1 to T10: scenarios, planners, requirements."""

from dataclasses import replace

from uavrt.planning.drone_model.drone_motion import Multirotor
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.stopping import AccuracyStop
from uavrt_experiments.search.reflection import Reflection
from uavrt_experiments.search.scenario import (
    APART,
    ERROR_THAN_ONE,
    FARTHEST,
    FASTER,
    PUBLISHED,
    STOPS,
    THAN_PUBLISHED,
    Bar,
    Contender,
    Known,
    Scenario,
    Truth,
)
from uavrt_experiments.search.stops import DeterminantStop, LongestAxisStop
from uavrt_experiments.search.terrain import Hills

_BASELINES = ("closest", "shannon", "renyi", "lawnmower", "rotation_points")
_WIDE = ("closest", "shannon", "renyi", "lawnmower", "lavapilot")
"""Planners for several square kilometres; turning at each point of a grid would take hours."""
_HARD = ("closest", "renyi", "lawnmower")


def _all(*planners: str) -> tuple[Contender, ...]:
    """Our planner with both stop rules, and the others."""
    return (
        Contender(planner="mi_rate"),
        Contender(planner="mi_rate", stop="ours"),
        *_others(*planners),
    )


def _others(*planners: str) -> tuple[Contender, ...]:
    """Other planners with the paper's stop rule; Rényi's with both filters."""
    return (
        *(Contender(planner=name) for name in planners),
        *((PUBLISHED,) if "renyi" in planners else ()),
    )


_TRACKERBOTS = Multirotor(
    speed_m_s=5.0, acceleration_m_s2=float("inf"), yaw_rate_deg_s=30.0, turns_first=True
)


def _trackerbots(name: str, title: str, threshold_db: float, *bars: Bar) -> Scenario:
    """Scenario of TrackerBots (Nguyen and others, Journal of Field Robotics 2019)."""
    return Scenario(
        name=name,
        title=title,
        east_m=500.0,
        north_m=500.0,
        tags=10,
        truth=Truth(
            level_1m_db=7.7,
            exponent=3.1,
            sigma_db=4.22,
            tag_height_m=1.0,
            threshold_db=threshold_db,
            walk_m_per_root_s=2.0,
        ),
        vehicle=_TRACKERBOTS,
        paper_stop=DeterminantStop(limit_m4=1e4),
        our_stop=AccuracyStop(radius95_m=28.0),
        bars=bars,
        contenders=_all(*_BASELINES),
    )


T1 = _trackerbots(
    "T1",
    "TrackerBots, every pulse detected",
    -1000.0,
    Bar(quantity="error, mean, m", most=12.5),
    Bar(quantity="time, mean, s", most=160.0),
    Bar(quantity="path, mean, km", most=0.75),
)
T2 = _trackerbots(
    "T2",
    "TrackerBots, pulses detected from -70 dBm",
    -70.0,
    Bar(quantity="error, mean, m", most=12.5),
    Bar(quantity="time, mean, s", most=260.0),
    Bar(quantity="complete, share", least=1.0),
    Bar(quantity=THAN_PUBLISHED, most=0.6),
)
_LAVA_PLACES = (
    *((700.0, 720.0), (840.0, 520.0), (310.0, 380.0), (160.0, 550.0), (820.0, 330.0)),
    *((510.0, 410.0), (140.0, 170.0), (250.0, 660.0), (580.0, 270.0), (540.0, 805.0)),
)
T4 = Scenario(
    name="T4",
    title="LAVAPilot: ten animals not to be disturbed",
    east_m=1000.0,
    north_m=1000.0,
    tags=10,
    places=_LAVA_PLACES,
    truth=Truth(
        level_1m_db=-39.67,
        exponent=2.0,
        sigma_db=8.86,
        reflection=Reflection(),
        tag_height_m=1.0,
        walk_m_per_root_s=0.5,
    ),
    vehicle=Multirotor(
        speed_m_s=10.0, acceleration_m_s2=5.0, yaw_rate_deg_s=60.0, turns_first=True
    ),
    paper_stop=LongestAxisStop(limit_m=15.0),
    our_stop=AccuracyStop(radius95_m=24.5),
    start_yaw_deg=-90.0,
    height_m=30.0,
    first_plan_s=16,
    cycle_s=8,
    stops_each_cycle=True,
    keep_away=KeepAway(radius_m=50.0, probability=0.93, margin=1.25),
    limit_s=1200,
    bars=(
        Bar(quantity="complete, share", least=1.0),
        Bar(quantity="time, median, s", most=290.0),
        Bar(quantity="time, p95, s", most=345.0),
        Bar(quantity="error, mean, m", most=12.0),
        Bar(quantity="inside the radius, share", most=0.05),
    ),
    contenders=_all("lavapilot", *_BASELINES, "conservationbots"),
)
T3 = Scenario(
    name="T3",
    title="TrackerBots' field: two animals that walk at 1.2 m/s, three that rest",
    east_m=75.0,
    north_m=300.0,
    tags=5,
    truth=Truth(
        level_1m_db=-15.28,
        exponent=2.0,
        sigma_db=2.31,
        reflection=Reflection(),
        tag_height_m=1.0,
        travellers=2,
        walk_speed_m_s=1.2,
    ),
    known=Known(motion=(0.5, 0.1, 0.4), walk_m_per_root_s=0.5, travelling_m_s=1.2),
    vehicle=_TRACKERBOTS,
    paper_stop=DeterminantStop(limit_m4=1e4),
    our_stop=AccuracyStop(radius95_m=24.5),
    height_m=30.0,
    limit_s=900,
    bars=(Bar(quantity="error, mean, m", most=15.0), Bar(quantity="time, mean, s", most=130.0)),
    contenders=_all(*_BASELINES),
)


def _conservationbots(name: str, tags: int, time_s: float) -> Scenario:
    """Scenario of ConservationBots on flat ground; places are drawn, because only five animals'
    are known.
    """
    return Scenario(
        name=name,
        title=f"ConservationBots on flat ground, {tags} animals, a tenth of the pulses missed",
        east_m=2000.0,
        north_m=2000.0,
        tags=tags,
        truth=Truth(
            level_1m_db=40.0,
            exponent=4.0,
            sigma_db=4.0,
            antenna="H3",
            tag_height_m=0.2,
            missed_share=0.1,
            vegetation_m=1.0,
            walk_m_per_root_s=2.5**0.5,
        ),
        # Of the plants it knows only that they take something, here more, there less.
        known=Known(level_sigma_db=3.0, level_drift_db_per_root_s=0.15, sigma_db=4.5),
        vehicle=Multirotor(speed_m_s=10.0, acceleration_m_s2=4.0, yaw_rate_deg_s=180.0),
        paper_stop=DeterminantStop(limit_m4=2e4),
        our_stop=AccuracyStop(radius95_m=30.0),
        start_m=(993.0, 504.0),
        height_m=60.0,
        cycle_s=10,
        keep_away=KeepAway(radius_m=50.0, probability=0.95, margin=1.25),
        limit_s=4000,
        bars=(
            Bar(quantity="complete, share", least=1.0),
            Bar(quantity="time, mean, s", most=time_s),
            Bar(quantity="error, RMS, m", most=17.0),
        ),
        contenders=_all("conservationbots", *_WIDE),
    )


T5 = _conservationbots("T5", 9, 1088.0)
T5_19 = _conservationbots("T5-19", 19, 1665.0)
T6 = replace(
    T5,
    name="T6",
    title="The nine animals of T5 over hills of 200 m, with a map of them; easier: flat",
    truth=replace(T5.truth, ground=Hills(seed=6)),
    known=replace(T5.known, map_of_heights=True),
    # 60 m above the highest top: a search flies at one height above its take-off.
    height_m=220.0,
    easier=T5,
    bars=(
        Bar(quantity="complete, share", least=1.0),
        Bar(quantity="error, RMS, m", most=30.0),
        Bar(quantity="time over that of the easier case", most=2.0),
    ),
    contenders=(
        Contender(planner="mi_rate"),
        Contender(planner="mi_rate", easier=True),
        Contender(planner="mi_rate", stop="ours"),
        Contender(planner="mi_rate", stop="ours", easier=True),
        *_others("conservationbots", *_WIDE),
    ),
)
T7 = Scenario(
    name="T7",
    title="Cliff: one animal that rests, in 1 km²",
    east_m=1000.0,
    north_m=1000.0,
    tags=1,
    truth=Truth(level_1m_db=-15.69, exponent=2.0, sigma_db=4.21),
    known=Known(motion=(1.0, 0.0, 0.0), walk_m_per_root_s=0.0),
    vehicle=_TRACKERBOTS,
    paper_stop=DeterminantStop(limit_m4=1e4),
    our_stop=AccuracyStop(radius95_m=24.5),
    height_m=40.0,
    bars=(
        Bar(quantity="complete, share", least=1.0),
        Bar(quantity="error, mean, m", most=20.0),
        Bar(quantity="time, mean, s", most=400.0),
    ),
    contenders=(
        Contender(planner="mi_rate"),
        Contender(planner="mi_rate", stop="ours"),
        Contender(planner="shannon", turn_s=45.0),
        Contender(planner="rotation_points"),
        Contender(planner="closest"),
    ),
    baseline_share=0.5,
)
_EASIER = tuple(
    Contender(planner="mi_rate", stop=stop, easier=easier)
    for stop in STOPS
    for easier in (False, True)
)
_STRENGTHS = replace(
    T2,
    name="T8",
    title="Strength (± 10 dB) and exponent (2 to 4) unknown; easier: both known",
    truth=replace(T2.truth, level_spread_db=10.0, exponent_range=(2.0, 4.0)),
    known=Known(level_sigma_db=6.0, exponent_sigma=0.6),
    bars=(Bar(quantity="time over that of the easier case", most=1.5),),
    contenders=(*_EASIER, *_others(*_HARD)),
)
T8 = replace(_STRENGTHS, easier=replace(_STRENGTHS, known=Known(each=True)))
T9 = replace(
    T2,
    name="T9",
    title="Strength (± 10 dB) and exponent unknown, two tags absent, 2 % false pulses",
    absent=2,
    truth=replace(T2.truth, level_spread_db=10.0, exponent_range=(2.8, 3.4), chance_share=0.02),
    known=Known(level_sigma_db=6.0, exponent_sigma=0.2),
    limit_s=1200,
    bars=(
        Bar(quantity="95 % circle holds, share", least=0.93, most=0.97),
        Bar(quantity="false found, share", most=0.01),
    ),
    contenders=(Contender(planner="mi_rate", stop="ours"), *_others(*_HARD)),
)
T10 = replace(
    T2,
    name="T10",
    title="Half of the pulses missed, 5 % false ones, two interferers; easier: none of these",
    truth=replace(T2.truth, missed_share=0.5, chance_share=0.05, strangers=2),
    easier=T2,
    bars=(
        Bar(quantity="complete, share", least=1.0),
        Bar(quantity="time over that of the easier case", most=1.5),
    ),
    contenders=(*_EASIER, *_others(*_HARD)),
)
_TOGETHER = tuple(
    Contender(planner="mi_rate", stop="ours", drones=drones, corners=corners)
    for drones, corners in ((1, False), (2, False), (3, False), (2, True), (3, True))
)
T2_DRONES = replace(
    T2,
    name="T2-drones",
    title="T2 flown by one drone, two and three, from one corner and from several",
    bars=(
        Bar(quantity="time, mean, s"),
        Bar(quantity=FASTER.format(2), least=1.6),
        Bar(quantity=FASTER.format(3), least=2.2),
        Bar(quantity="error, mean, m"),
        Bar(quantity=ERROR_THAN_ONE, most=1.1),
        Bar(quantity=APART, least=1.0),
        Bar(quantity=FARTHEST),
    ),
    contenders=_TOGETHER,
)
T5_DRONES = replace(
    T5,
    name="T5-drones",
    title="Four animals not to be disturbed in 1 km², two drones and three",
    east_m=1000.0,
    north_m=1000.0,
    tags=4,
    start_m=(0.0, 0.0),
    limit_s=900,
    bars=(
        Bar(quantity="complete, share"),
        Bar(quantity=APART, least=1.0),
        Bar(quantity="inside the radius, share", most=0.01),
    ),
    contenders=tuple(one for one in _TOGETHER if one.drones > 1),
)
SCENARIOS: dict[str, Scenario] = {
    one.name: one
    for one in (T1, T2, T2_DRONES, T3, T4, T5, T5_19, T5_DRONES, T6, T7, T8, T9, T10)
}
"""Scenarios by name."""
