"""``uavrt coverage``: map where a tag would be detected, before or after a flight."""

# isort: off
from uavrt.cli.options.link_budget_options import USUAL_BUDGET, Budget
from uavrt.cli.options.inputs import chosen_tags, refuse
from uavrt.cli.options.elevation_option import elevation_of
from uavrt.cli.options.kinds import (
    DecibelsOfError,
    GroupPulses,
    Heights,
    Interval,
    Power,
    PulseWidth,
    Reach,
    Share,
    Side,
    Speed,
    TagFrequency,
    TagIds,
)
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.core.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.cli.prediction.coverage_of_tags import MappedTag
    from uavrt.core.messages import Tag

_HEIGHT_M, _SPEED_M_S, _SPACING_M = 60.0, 8.0, 200.0
_PULSES, _FREQUENCY_HZ, _PULSE_WIDTH_S, _INTERVAL_S = 3, 150e6, 0.020, 1.254


def coverage(
    source: Path,
    *,
    tag_power: Power,
    dem: Path | None = None,
    sea: Annotated[bool, Parameter(negative="")] = False,
    area: Path | None = None,
    prior: Share | None = None,
    height: Heights = (_HEIGHT_M,),
    speed: Speed = _SPEED_M_S,
    spacing: Side = _SPACING_M,
    margin: Reach = 2000.0,
    cell: Side | None = None,
    tags: Path | None = None,
    tag: TagIds = (),
    pulses: GroupPulses = _PULSES,
    frequency: TagFrequency = _FREQUENCY_HZ,
    pulse_width: PulseWidth = _PULSE_WIDTH_S,
    interval: Interval = _INTERVAL_S,
    antenna: str | None = None,
    budget: Budget = USUAL_BUDGET,
    level_error: DecibelsOfError = 3.0,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Map the probability that a tag is detected, hills included.

    Before a flight, SOURCE is a plan or an area; of several heights the best is shown. After a
    flight it is the flight directory: the map then shows the probability that a tag at each
    place would be detected, from the drone's path, its antenna's direction and its noise.
    The probability is that of groups of pulses, or of the whole flight if uavrt integrate has
    searched for the tag. With --area, undetected tags also get the probability that they
    are outside.

    Parameters
    ----------
    source
        A plan (QGroundControl's .plan), a path or an area (GeoJSON, KML), or a flight
        directory.
    tag_power
        Power that the tag radiates [dBm], antenna and animal included; collars: -30 to -10.
    dem
        Heights of the ground: an SRTM tile (N47E008.hgt), a GeoTIFF, or a folder of these.
        Without it the ground is level.
    sea
        Treat ground that no elevation file covers as water at height 0.
    area
        Outline (GeoJSON, KML, .plan) of an area, for the probability that the tag is in it.
    prior
        For a past flight: probability before it that the tag was in --area; by default all
        places on the map are equally probable.
    height
        Height of the drone above the ground [m]; several are compared. A flight has its own.
    speed
        Speed of the drone [m/s]; a flight has its own.
    spacing
        Distance between the lines over an area [m].
    margin
        Width of the map's margin around the path or area [m].
    cell
        Side of the map's squares [m]. By default 20 before a flight; after it as in the
        report: 120 squares along the longer side, each of 20 m or more.
    tags
        A tag file; by default a flight's own tags, or else one tag by the options below.
    tag
        Only these tags of a flight or of --tags, by their ids.
    pulses
        Pulses in a group (K), without --tags.
    frequency
        The tag's frequency [Hz], without --tags.
    pulse_width
        The tag's pulse width [s], without --tags.
    interval
        The tag's pulse interval [s], without --tags.
    antenna
        Name of the antenna's pattern, or a CSV file of angles and gains. It points in the
        direction of flight, or as the flight recorded it. monopole: equal on all sides, and
        without reception from below. By default monopole before a flight; after it the
        drone's own (bearings.antenna), else RA-23K.
    level_error
        Standard deviation of the tag's level [dB]: power, animal, ground.
    output
        Directory for the maps, as GeoTIFF and PNG.
    as_json
        Print a list of objects.
    """
    from uavrt.cli.prediction.coverage_of_tags import (
        CoverageOptions,
        maps_of_flight,
        maps_of_plan,
    )
    from uavrt.cli.shown.outputs import make_directory, print_json

    if not height:
        raise ConfigError(
            "the flight height is missing",
            remedy="Give it with --height, for example --height 60",
        )
    _check_used(
        source,
        of_plan={
            "--height": height != (_HEIGHT_M,),
            "--speed": speed != _SPEED_M_S,
            "--spacing": spacing != _SPACING_M,
        },
        of_one_tag={
            "--pulses": pulses != _PULSES,
            "--frequency": frequency != _FREQUENCY_HZ,
            "--pulse-width": pulse_width != _PULSE_WIDTH_S,
            "--interval": interval != _INTERVAL_S,
        },
        area=area,
        prior=prior,
        tags=tags,
        ids=tag,
    )
    if output is not None:
        make_directory(output, "--output")
    asked = CoverageOptions(
        source=source,
        elevation=elevation_of(dem, sea=sea),
        outline=area,
        prior=prior,
        heights_m=tuple(sorted(set(height))),
        speed_m_s=speed,
        spacing_m=spacing,
        margin_m=margin,
        cell_m=cell,
        antenna=_named(antenna),
        level_sigma_db=level_error,
        budget=budget.link(
            power_dbm=tag_power,
            height_m=height[0],
            frequency_hz=frequency,
            pulse_width_s=pulse_width,
        ),
        output=output,
    )
    found = (
        maps_of_flight(asked, tags, tag)
        if source.is_dir()
        else maps_of_plan(asked, _listed(tags, tag, pulses, interval, frequency, pulse_width))
    )
    if as_json:
        print_json([_record(one) for one in found], indent=2)
    else:
        _print(found)


def _check_used(
    source: Path,
    *,
    of_plan: dict[str, bool],
    of_one_tag: dict[str, bool],
    area: Path | None,
    prior: float | None,
    tags: Path | None,
    ids: tuple[int, ...],
) -> None:
    """Reject options that would have no effect; raises `ConfigError`."""
    if source.is_dir():
        refuse(of_plan, "{} applies to a plan; a flight has its own value")
        refuse(of_one_tag, "{} describes a tag without a list; a flight has its own list")
        if prior is not None and area is None:
            raise ConfigError("--prior needs an area", remedy="Name the area with --area")
        return
    if prior is not None:
        raise ConfigError(
            "--prior applies to a flight without a detection of the tag, not to a plan or area",
            remedy="Leave --prior out, or name the flight's directory",
        )
    if tags is not None:
        refuse(of_one_tag, "{} describes a tag without a list; --tags has its own values")
    elif ids:
        raise ConfigError(
            f"--tag {ids[0]} needs a list of tags",
            remedy="Name the tag file with --tags, or leave --tag out",
        )


def _named(antenna: str | None) -> str | None:
    from uavrt.analysis.measure.antenna_files import antenna_named

    return None if antenna is None else antenna_named(antenna)


def _listed(
    tags: Path | None,
    ids: tuple[int, ...],
    pulses: int,
    interval_s: float,
    frequency_hz: float,
    pulse_width_s: float,
) -> "list[Tag]":
    from uavrt.analysis.covered.coverage_maps import assumed_tag
    from uavrt.config.tags.tag_files import read_tags

    if tags is not None:
        return chosen_tags(read_tags(tags), ids)
    if interval_s <= 2.0 * pulse_width_s:
        raise ConfigError(
            f"the interval of {interval_s:g} s is too short for pulses of {pulse_width_s:g} s",
            remedy="Give a longer --interval",
        )
    return [
        assumed_tag(
            frequency_hz=frequency_hz,
            pulse_width_s=pulse_width_s,
            interval_s=interval_s,
            k=pulses,
        )
    ]


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, 4)


def _record(one: "MappedTag") -> dict[str, Any]:
    ground, silence = one.coverage.ground, one.absence
    return {
        "tag_id": one.tag.tag_id,
        "height_m": one.height_m,
        "best": one.best,
        "map_km2": round(one.coverage.known_km2, 3),
        "unknown_share": _finite(ground.unknown_share),
        "groups": one.coverage.groups,
        "mean_probability": _finite(one.coverage.mean),
        "share50": _finite(one.coverage.share_above(0.5)),
        "share90": _finite(one.coverage.share_above(0.9)),
        "area_probability": _finite(one.in_area),
        "heard_pulses": one.heard,
        "in_hindsight": one.in_hindsight,
        "whole_flight": one.coverage.whole_flight,
        "prior": None if silence is None else _finite(silence.prior),
        "not_here": None if silence is None else _finite(silence.not_here),
        "sure_within_m": None if one.silent is None else one.silent.within_m,
        "noise": one.noise,
        "antenna": one.antenna,
        "limitations": list(one.coverage.limitations),
        "files": [str(path) for path in one.files],
    }


def _print(found: "list[MappedTag]") -> None:
    from uavrt.analysis.covered.silence import around_in_words

    for one in found:
        where = "in this flight" if one.height_m is None else f"from {one.height_m:g} m"
        best = " (best)" if one.best and len(found) > 1 and one.height_m is not None else ""
        print(f"tag {one.tag.tag_id} {where}{best}: {_percent(one.coverage.mean)} on average")
        if one.coverage.whole_flight:
            print("  calculated for uavrt integrate, which did not find it")
        share50, share90 = (_percent(one.coverage.share_above(share)) for share in (0.5, 0.9))
        print(
            f"  detected with .9 or more on {share90} of {one.coverage.known_km2:.1f} km², "
            f"with .5 or more on {share50}"
        )
        print(f"  antenna: {_antenna_in_words(one.antenna)}")
        if one.in_area is not None:
            print(f"  in the area: {_percent(one.in_area)}")
        if one.heard:
            print(f"  it was detected: {one.heard} confirmed pulses")
        if one.in_hindsight:
            print("  it was found over the whole flight (uavrt integrate)")
        if one.silent is not None:
            print(f"  {around_in_words(one.silent)}")
        if one.absence is not None:
            print(
                f"  not detected: not here, p = {one.absence.not_here:.3f} (it was in the area "
                f"with {one.absence.prior:.3f} before the flight)"
            )
        if one.noise is not None:
            print(f"  noise of the drone: {one.noise}")
        for text in one.coverage.limitations:
            print(f"  note: {text}")
        for path in one.files:
            print(f"  {path}")


def _antenna_in_words(name: str) -> str:
    from uavrt.localization.antenna import MONOPOLE

    return f"{name}, alike on all sides" if name == MONOPOLE else name


def _percent(share: float) -> str:
    return "unknown" if not math.isfinite(share) else f"{100.0 * share:.0f} %"
