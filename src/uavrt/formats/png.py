"""Encode a picture as PNG (W3C PNG, 2nd edition) without an image library."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """Encode pixels (rows, columns, 4) as PNG; the first row is at the top of the picture.

    The four values of a pixel are red, green, blue and opacity.
    """
    rows, columns, _ = pixels.shape
    header = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)
    unfiltered = np.zeros((rows, 1 + 4 * columns), np.uint8)
    unfiltered[:, 1:] = pixels.reshape(rows, -1)
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", header),
            _chunk(b"IDAT", zlib.compress(unfiltered.tobytes(), 9)),
            _chunk(b"IEND", b""),
        )
    )


def disc(radius: int, color: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Draw a filled disc with a white rim, as an icon for maps."""
    offset = np.arange(-radius, radius + 1)
    distance = np.hypot(offset[:, None], offset[None, :])
    pixels = np.zeros((*distance.shape, 4), np.uint8)
    pixels[distance <= radius] = (255, 255, 255, 255)
    pixels[distance <= radius - 2] = (*color, 255)
    return pixels


def heat(probability: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colour a probability map from yellow to dark red; values near zero are transparent.

    The first row is at the top of the picture.
    """
    peak = float(probability.max())
    share = probability / peak if peak > 0.0 else np.zeros_like(probability)
    pixels = np.zeros((*share.shape, 4), np.uint8)
    pixels[..., 0] = (255 - 115 * share).astype(np.uint8)
    pixels[..., 1] = (230 * (1.0 - share) ** 1.5).astype(np.uint8)
    pixels[..., 3] = np.where(share > 0.01, 60 + 150 * np.sqrt(share), 0).astype(np.uint8)
    return pixels


def signal(snr_db: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colour a map of SNR [dB] from blue (weak) to yellow (strong); NaN is transparent.

    The first row is at the top of the picture.
    """
    known = np.isfinite(snr_db)
    low, high = (snr_db[known].min(), snr_db[known].max()) if known.any() else (0.0, 1.0)
    share = np.where(known, (snr_db - low) / max(float(high - low), 1e-9), 0.0)
    pixels = np.zeros((*share.shape, 4), np.uint8)
    pixels[..., 0] = (70 + 180 * share**1.5).astype(np.uint8)
    pixels[..., 1] = (20 + 210 * share).astype(np.uint8)
    pixels[..., 2] = (120 * (1.0 - share) + 30).astype(np.uint8)
    pixels[..., 3] = np.where(known, 150, 0).astype(np.uint8)
    return pixels


def chance(probability: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colour a map of probabilities from dark blue (0) to yellow (1); NaN is transparent."""
    known = np.isfinite(probability)
    share = np.where(known, probability, 0.0)
    pixels = np.zeros((*share.shape, 4), np.uint8)
    for plane, (none, half, sure) in enumerate(((48, 34, 253), (18, 144, 231), (84, 140, 37))):
        levels = np.interp(share, (0.0, 0.5, 1.0), (none, half, sure))
        pixels[..., plane] = levels.astype(np.uint8)
    pixels[..., 3] = np.where(known, 200, 0).astype(np.uint8)
    return pixels


def _chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)
