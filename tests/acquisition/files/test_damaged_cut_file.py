"""Cut recordings with flipped bits, zeroed parts and lost ends, with and without their checksum: rejected fast."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, DataError
from acquisition.files.cut_file import CutSignal, write_cut_signal
from acquisition.files.read_cut import read_cut_recording

CHANNEL = Channel("acceleration", 1.02e-2, 5.0)
CODES = np.random.default_rng(0).integers(-900, 900, 3000).astype(np.int32)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    write_cut_signal(
        tmp_path / "c1.h5",
        CutSignal(np.asarray(CODES * CHANNEL.scale, np.float64), 51200.0, CODES, CHANNEL),
        {"id": "c1"},
    )
    return tmp_path / "c1.h5"


def damaged(content: bytes, chance: random.Random) -> bytes:
    """Return a file with one kind of damage; half of them lose their end with the checksum too."""
    spoilt = bytearray(content)
    kind = chance.choice(("bit", "bits", "cut", "zeros"))
    at = chance.randrange(len(spoilt))
    if kind in ("bit", "bits"):
        for _ in range(1 if kind == "bit" else 5):
            spoilt[chance.randrange(len(spoilt))] ^= 1 << chance.randrange(8)
    elif kind == "cut":
        del spoilt[at:]
    else:
        part = slice(at, at + chance.choice((1, 8, 64, 512)))
        spoilt[part] = bytes(len(spoilt[part]))
    return bytes(spoilt[: -chance.choice((1, 200))] if chance.random() < 0.5 else spoilt)


def refused(recording: Path, rounds: int) -> int:
    """Count the rejected copies; the others must be whole."""
    content, count = recording.read_bytes(), 0
    for seed in range(rounds):
        spoilt = damaged(content, random.Random(seed))
        recording.write_bytes(spoilt)
        try:
            sound = read_cut_recording(recording)
        except DataError:
            count += 1
        else:
            assert spoilt == content, seed
            np.testing.assert_array_equal(sound.codes, CODES)
    return count


@pytest.mark.timeout(60)
def test_damaged_recordings_are_rejected(recording: Path) -> None:
    assert refused(recording, 150) >= 130


@pytest.mark.long
@pytest.mark.timeout(600)
def test_five_thousand_damaged_recordings_are_rejected(recording: Path) -> None:
    assert refused(recording, 5000) >= 4500
