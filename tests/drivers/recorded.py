"""Samples for waterfalls: a recording with one pulse, and datagrams of a channel."""

import json
from pathlib import Path

import numpy as np

from uavrt.radio.channels.channel_datagram import encode_channel_datagram

RATE_HZ, CENTRE_HZ, START_NS = 375_000.0, 148_700_000.0, 1_700_000_000_000_000_000


def write_recording(folder: Path, seconds: float = 3.0) -> None:
    """Noise, and a pulse of 20 ms 1.5 s after the start, 200 Hz above the tag."""
    rng = np.random.default_rng(3)
    count = round(seconds * RATE_HZ)
    samples = (rng.normal(size=count) + 1j * rng.normal(size=count)) * 0.01
    at = np.arange(round(1.5 * RATE_HZ), round(1.52 * RATE_HZ))
    at = at[at < count]
    samples[at] += 0.003 * np.exp(2j * np.pi * 12_200.0 * at / RATE_HZ)
    folder.mkdir(parents=True)
    samples.astype(np.complex64).tofile(folder / "band.sigmf-data")
    facts = {
        "global": {
            "core:datatype": "cf32_le",
            "core:sample_rate": RATE_HZ,
            "core:version": "1.0.0",
        },
        "captures": [
            {
                "core:sample_start": 0,
                "core:frequency": CENTRE_HZ,
                "core:datetime": "2023-11-14T22:13:20Z",
            }
        ],
        "annotations": [],
    }
    (folder / "band.sigmf-meta").write_text(json.dumps(facts))


def frames(tone_hz: float, count: int) -> list[bytes]:
    """Datagrams of a channel as the drone sends them: noise, and a tone all the time."""
    rng = np.random.default_rng(5)
    time_s = np.arange(count * 1024) / 3750.0
    noise = 0.1 * (rng.normal(size=time_s.size) + 1j * rng.normal(size=time_s.size))
    samples = (noise + np.exp(2j * np.pi * tone_hz * time_s)).astype(np.complex64)
    return [
        bytes(encode_channel_datagram(samples[at : at + 1024], START_NS + round(at / 3750e-9)))
        for at in range(0, samples.size, 1024)
    ]
