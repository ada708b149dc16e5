"""Hit files that nothing vouches for: whole without a seal, and rubbish."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from acquisition import Channel, Circumstances, Hit, HitFlags, write_hit
from acquisition.files.hdf5_file import CHECKSUM_SIZE
from lobewatch.machine.journal.unverified_tap import has_readable_hits


def test_hits_without_a_seal_are_whole_only_where_they_can_be_read(tmp_path: Path) -> None:
    path, channels = tmp_path / "0001.h5", (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))
    codes = np.arange(200, dtype=np.int32).reshape(2, 100)
    hit = Hit(1.0 * codes[0], 2.0 * codes[1], 25600.0, channels=channels, codes=codes)
    write_hit(path, hit, Circumstances("mill", datetime(2026, 1, 15, tzinfo=UTC)), HitFlags.OK)
    whole = path.read_bytes()
    path.write_bytes(whole[:-CHECKSUM_SIZE])
    assert has_readable_hits(path)
    path.write_bytes(whole[: len(whole) // 2])
    assert not has_readable_hits(path)
    path.write_bytes(whole[:100] + b"x" + whole[101:])
    assert not has_readable_hits(path)
