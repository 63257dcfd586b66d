"""Which detector answers for which tag on ROS 2."""

import made

from uavrt.config.settings import Settings
from uavrt.link.ros2.status import component_status


def test_tags_of_one_band_show_the_one_worker_that_serves_both() -> None:
    status = made.system_status(
        center_frequency_hz=148.7e6,
        tags=(made.tag(2, 148.6e6), made.tag(4, 148.6005e6), made.tag(6, 148.9e6)),
        processes=(
            made.process_status("receiver", "detecting"),
            made.process_status("detector-1", "detecting", tag_ids=(2, 4)),
            made.process_status("detector-2", "dead", running=False, ok=False, tag_ids=(6,)),
        ),
    )
    shown = component_status("detector", status, 0.0, Settings())
    assert [(one.hardware_id, one.message, one.values[0].value) for one in shown] == [
        ("tag_id_2", "alive", "detector-1"),
        ("tag_id_4", "alive", "detector-1"),
        ("tag_id_6", "dead", "detector-2"),
    ]
