"""What is read of the DDS library's warnings, as release 11.0.1 writes them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from uavrt.link.ros2.network import dds_warnings
from uavrt.link.ros2.network.dds_warnings import DdsWarnings

TOO_LONG = (
    "1795877120.811663 [175]       recv: dropping oversize (16000084 > 4194304) sample 1 from "
    "remote writer 11064f8:feec3a8e:ad43d271:203 "
    "rt/drone1/store_coded_tag_information/uavrt_interfaces::msg::dds_::CodedTag_\n"
)
OTHER = (
    "1795877120.9 [175]  recv: dropping oversize (9 > 8) SPDP sample 1 from remote writer 1\n"
)
TOPIC = "rt/drone1/store_coded_tag_information"


@pytest.fixture
def warnings() -> Iterator[DdsWarnings]:
    found = DdsWarnings()
    yield found
    found.opened()
    found.close()
    assert not Path(found.path).exists()


def append(warnings: DdsWarnings, text: str) -> None:
    with Path(warnings.path).open("a", encoding="utf-8") as file:
        file.write(text)


def test_each_message_that_was_too_long_is_found_once_with_its_topic(
    warnings: DdsWarnings,
) -> None:
    assert warnings.too_long() == []
    append(warnings, TOO_LONG + OTHER + TOO_LONG[:50])
    assert warnings.too_long() == [TOPIC]
    assert warnings.too_long() == [], "half a line waits for its end"
    append(warnings, TOO_LONG[50:])
    assert warnings.too_long() == [TOPIC]


def test_the_file_stays_short(warnings: DdsWarnings) -> None:
    found = 0
    for _ in range(100):
        append(warnings, TOO_LONG * 100)
        found += len(warnings.too_long())
    assert found == 10_000
    assert Path(warnings.path).stat().st_size < 2 * dds_warnings.FILE_BYTES
