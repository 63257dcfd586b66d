"""From recordings and flights to results."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.analysis.bearings import (
        TagBearing,
        bearings_of_flight,
        bearings_of_pulses,
        learnt_antenna,
        read_bearings,
    )
    from uavrt.analysis.coverage import (
        MapSize,
        best_of,
        flight_coverage,
        flight_plane,
        inside,
        map_around,
        plan_coverage,
        read_places,
        read_polygon,
        write_maps,
    )
    from uavrt.analysis.flight_noise import FlightNoise, flight_noise_of
    from uavrt.analysis.fold_pictures import write_fold_pictures
    from uavrt.analysis.found_bursts import bursts_of_pulses
    from uavrt.analysis.hindsight import save_integrated, verdict_of
    from uavrt.analysis.kept_samples import channel_of, integrate_kept, kept_channels
    from uavrt.analysis.map_files import RASTERS, MapFile, maps_in, read_map
    from uavrt.analysis.plots import DetectionPlots
    from uavrt.analysis.positions import (
        TagPosition,
        check_position_method,
        position_of_strength,
        positions_of_bearings,
        positions_of_powers,
        read_positions,
    )
    from uavrt.analysis.power_survey import MONOPOLE, HeardStrength
    from uavrt.analysis.season import AnimalOfSeason, Season, read_season
    from uavrt.analysis.several_flights import (
        TagOfFlights,
        common_tags,
        judge_together,
        share_alone,
    )
    from uavrt.analysis.silence import ListenedFlight, SilentMap, silent_map
    from uavrt.analysis.survey import Survey, read_survey
    from uavrt.analysis.whole_flight import (
        LEAST_PART,
        POSITION_M,
        IntegratedTag,
        chance_in_words,
        integrate_flight,
    )

__all__ = [
    "LEAST_PART",
    "MONOPOLE",
    "POSITION_M",
    "RASTERS",
    "AnimalOfSeason",
    "DetectionPlots",
    "FlightNoise",
    "HeardStrength",
    "IntegratedTag",
    "ListenedFlight",
    "MapFile",
    "MapSize",
    "Season",
    "SilentMap",
    "Survey",
    "TagBearing",
    "TagOfFlights",
    "TagPosition",
    "bearings_of_flight",
    "bearings_of_pulses",
    "best_of",
    "bursts_of_pulses",
    "chance_in_words",
    "channel_of",
    "check_position_method",
    "common_tags",
    "flight_coverage",
    "flight_noise_of",
    "flight_plane",
    "inside",
    "integrate_flight",
    "integrate_kept",
    "judge_together",
    "kept_channels",
    "learnt_antenna",
    "map_around",
    "maps_in",
    "plan_coverage",
    "position_of_strength",
    "positions_of_bearings",
    "positions_of_powers",
    "read_bearings",
    "read_map",
    "read_places",
    "read_polygon",
    "read_positions",
    "read_season",
    "read_survey",
    "save_integrated",
    "share_alone",
    "silent_map",
    "verdict_of",
    "write_fold_pictures",
    "write_maps",
]
__getattr__ = lazily(
    __name__,
    {
        "AnimalOfSeason": "season",
        "Season": "season",
        "read_season": "season",
        "DetectionPlots": "plots",
        "FlightNoise": "flight_noise",
        "HeardStrength": "power_survey",
        "IntegratedTag": "whole_flight",
        "LEAST_PART": "whole_flight",
        "ListenedFlight": "silence",
        "MONOPOLE": "power_survey",
        "MapFile": "map_files",
        "MapSize": "coverage",
        "POSITION_M": "whole_flight",
        "RASTERS": "map_files",
        "SilentMap": "silence",
        "Survey": "survey",
        "TagBearing": "bearings",
        "TagOfFlights": "several_flights",
        "TagPosition": "positions",
        "bearings_of_flight": "bearings",
        "bearings_of_pulses": "bearings",
        "best_of": "coverage",
        "chance_in_words": "whole_flight",
        "channel_of": "kept_samples",
        "check_position_method": "positions",
        "flight_coverage": "coverage",
        "flight_noise_of": "flight_noise",
        "flight_plane": "coverage",
        "inside": "coverage",
        "common_tags": "several_flights",
        "integrate_flight": "whole_flight",
        "integrate_kept": "kept_samples",
        "judge_together": "several_flights",
        "kept_channels": "kept_samples",
        "learnt_antenna": "bearings",
        "map_around": "coverage",
        "maps_in": "map_files",
        "plan_coverage": "coverage",
        "position_of_strength": "positions",
        "positions_of_bearings": "positions",
        "positions_of_powers": "positions",
        "read_bearings": "bearings",
        "read_map": "map_files",
        "read_places": "coverage",
        "read_polygon": "coverage",
        "read_positions": "positions",
        "read_survey": "survey",
        "save_integrated": "hindsight",
        "silent_map": "silence",
        "share_alone": "several_flights",
        "verdict_of": "hindsight",
        "write_fold_pictures": "fold_pictures",
        "write_maps": "coverage",
        "bursts_of_pulses": "found_bursts",
    },
)
