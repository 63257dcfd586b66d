"""The web server of the ground station: routes, access control, and the data they serve.

`server` opens the sockets, `guard` decides who may connect, `api`, `drone_flights` and
`fleet_api` are the routes, `page` joins fleet and server. The other modules answer requests:
tag tables, maps, reports, exports, waterfalls, and which buttons are enabled.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ground.web.actions import (
        ACTIONS,
        COMMAND_OF_ACTION,
        Busy,
        Situation,
        action_states,
    )
    from uavrt.ground.web.commanding_page import Commander
    from uavrt.ground.web.coordinates import readout
    from uavrt.ground.web.listeners import Hub
    from uavrt.ground.web.page import PageSettings, PageStation
    from uavrt.ground.web.server import ServerSettings
    from uavrt.ground.web.snapshots import hello, pose_record, snapshot, vehicle_record
    from uavrt.ground.web.tag_table import (
        import_rows,
        not_selected,
        read_table,
        rows_from_tags,
        table_version,
        tags_from_rows,
    )

__all__ = [
    "ACTIONS",
    "COMMAND_OF_ACTION",
    "Busy",
    "Commander",
    "Hub",
    "PageSettings",
    "PageStation",
    "ServerSettings",
    "Situation",
    "action_states",
    "hello",
    "import_rows",
    "not_selected",
    "pose_record",
    "read_table",
    "readout",
    "rows_from_tags",
    "snapshot",
    "table_version",
    "tags_from_rows",
    "vehicle_record",
]
__getattr__ = lazily(
    __name__,
    {
        "import_rows": "tag_table",
        "not_selected": "tag_table",
        "tags_from_rows": "tag_table",
        "ACTIONS": "actions",
        "Busy": "actions",
        "COMMAND_OF_ACTION": "actions",
        "Commander": "commanding_page",
        "Hub": "listeners",
        "PageSettings": "page",
        "PageStation": "page",
        "ServerSettings": "server",
        "Situation": "actions",
        "action_states": "actions",
        "hello": "snapshots",
        "pose_record": "snapshots",
        "read_table": "tag_table",
        "readout": "coordinates",
        "rows_from_tags": "tag_table",
        "snapshot": "snapshots",
        "table_version": "tag_table",
        "vehicle_record": "snapshots",
    },
)
