"""The page lists what beeps beside the listed tags; one press corrects the list."""

import made
import pytest
from page_driver import WAIT_MS, Scene
from playwright.sync_api import expect
from until import until

from uavrt.config.tags.tag_files import read_tags, write_tags
from uavrt.core.messages import BeepKind
from world import THESIS_TAG

pytestmark = pytest.mark.timeout(240)


def test_a_wrong_label_is_corrected_by_one_press_and_undone_by_another(
    scene: Scene,
) -> None:
    write_tags(scene.here / "tags.toml", [THESIS_TAG])
    drone = scene.drone()
    watched = scene.watch()
    page = watched.page
    page.click("#act-send_tags")
    expect(page.locator("#act-send_tags")).to_contain_text("Tags sent", timeout=WAIT_MS)
    page.click("#act-start")
    expect(page.locator("#chip-state")).to_have_text("Detecting", timeout=WAIT_MS)
    drone.world.beeps.extend(
        (
            made.beep(frequency_hz=148_710_640.0, tag_ids=(2,), offsets_hz=(640.0,)),
            made.beep(BeepKind.UNLISTED, frequency_hz=148_935_200.0, interval_s=1.102),
            made.beep(
                BeepKind.IMAGE,
                frequency_hz=148_689_360.0,
                image_of_hz=148_710_640.0,
                tag_ids=(2,),
                offsets_hz=(640.0,),
            ),
        )
    )
    box = page.locator("#beeps")
    expect(box).to_contain_text("tag 2, 640 Hz above its label", timeout=4 * WAIT_MS)
    expect(box).to_contain_text("unlisted", timeout=4 * WAIT_MS)
    expect(box).to_contain_text("148.9352\u202fMHz · every 1102\u202fms")
    expect(box).to_contain_text("spurious image of 148.710640 MHz (tag 2)", timeout=4 * WAIT_MS)
    watched.picture("beeps")
    page.get_by_role("button", name="Set tag 2 to the measured frequency").click()
    expect(box).to_contain_text(
        "tag 2: 148.710640 MHz, was 148.710000 MHz", timeout=4 * WAIT_MS
    )
    assert read_tags(scene.here / "tags.toml")[0].frequency_hz == 148_710_640.0
    until(lambda: drone.world.mission.upload.tags[2].frequency_hz == 148_710_640.0)
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    watched.picture("beeps-corrected")
    page.get_by_role("button", name="Undo").click()
    expect(box).not_to_contain_text("above its label", timeout=4 * WAIT_MS)
    expect(box.get_by_role("button")).to_have_count(0, timeout=4 * WAIT_MS)
    until(lambda: drone.world.mission.upload.tags[2].frequency_hz == THESIS_TAG.frequency_hz)
    expect(page.locator("#act-send_tags")).to_contain_text("Tags sent")


def test_an_offset_of_all_tags_is_shown_with_one_button_for_the_receiver(scene: Scene) -> None:
    tags = [made.tag(2, 148_710_000.0), made.tag(4, 148_760_000.0)]
    write_tags(scene.here / "tags.toml", tags)
    drone = scene.drone()
    page = scene.watch().page
    for action in ("send_tags", "start"):
        page.click(f"#act-{action}")
    expect(page.locator("#chip-state")).to_have_text("Detecting", timeout=WAIT_MS)
    drone.world.beeps.extend(
        made.beep(
            BeepKind.LISTED,
            frequency_hz=tag.frequency_hz + 300.0,
            tag_ids=(tag.tag_id,),
            offsets_hz=(300.0,),
        )
        for tag in tags
    )
    box = page.locator("#beeps")
    expect(box).to_contain_text("All tags are +2.0 ppm off", timeout=4 * WAIT_MS)
    expect(box.get_by_role("button", name="Correct the receiver's frequency")).to_have_count(1)
    expect(box.get_by_role("button", name="to the measured frequency")).to_have_count(0)
