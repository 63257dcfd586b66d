"""Colours of the page, as people see them who see some colours not.

Colour-blind vision by the matrices of Machado, Oliveira and Fernandes (2009, severity 1), which
hold for linear RGB; differences in CIELAB (CIE 1976), of which 2.3 is just noticeable.
"""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

PAGE = Path(__file__).parents[3] / "page/src"
VISION = {
    "all colours": np.eye(3),
    "no red": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "no green": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "no blue": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
TO_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)
"""IEC 61966-2-1 (sRGB)."""
EASILY_TOLD = 9.0


def linear(colour: str) -> NDArray[np.float64]:
    shares = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)


def lab(colour: str, vision: NDArray[np.float64]) -> NDArray[np.float64]:
    seen = np.clip(vision @ linear(colour), 0.0, 1.0)
    x, y, z = np.cbrt(np.maximum(TO_XYZ @ seen / (TO_XYZ @ np.ones(3)), 1e-6))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def contrast(one: str, other: str) -> float:
    """WCAG 2.1, contrast ratio."""
    bright = sorted(float(TO_XYZ[1] @ linear(colour)) for colour in (one, other))
    return (bright[1] + 0.05) / (bright[0] + 0.05)


def colours(name: str) -> list[str]:
    text = (PAGE / "shared/colour.ts").read_text(encoding="utf-8")
    (body,) = re.findall(rf"const {name}\b.*?= \[(.*?)\];", text, re.DOTALL)
    return re.findall(r"#[0-9a-f]{6}", body)


def theme(name: str) -> dict[str, str]:
    text = (PAGE / "style.css").read_text(encoding="utf-8")
    body = text[text.index(name) :].split("}")[0]
    return dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", body))


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("name", ["TAG_COLOURS", "TAG_COLOURS_DARK"])
def test_tags_are_told_apart(name: str, vision: str) -> None:
    found = colours(name)
    assert len(found) == 6
    apart = {
        pair: float(np.linalg.norm(lab(pair[0], VISION[vision]) - lab(pair[1], VISION[vision])))
        for pair in itertools.combinations(found, 2)
    }
    assert min(apart.values()) >= EASILY_TOLD, min(apart, key=apart.__getitem__)


@pytest.mark.parametrize("vision", VISION)
def test_strength_grows_brighter_evenly(vision: str) -> None:
    bright = np.array([lab(colour, VISION[vision])[0] for colour in colours("STOPS")])
    steps = np.diff(bright)
    assert (steps > 5.0).all()
    assert steps.max() < 3.0 * steps.min()


@pytest.mark.parametrize("name", [":root", '[data-theme="dark"]'])
def test_words_are_readable_on_their_ground(name: str) -> None:
    own = theme(name)
    for words in ("ink", "soft", "good", "warn", "bad", "accent"):
        for ground in ("paper", "sheet"):
            assert contrast(own[words], own[ground]) >= 4.5, (words, ground)


def test_no_state_is_told_by_colour_alone() -> None:
    text = (PAGE / "style.css").read_text(encoding="utf-8")
    shapes = dict(re.findall(r'\.chip(\.\w+)?::before \{ content: "(.)"', text))
    assert len(set(shapes.values())) == len(shapes) == 3
