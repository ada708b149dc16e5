"""Hits of a known structure, to be laid out in files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition import Structure

RATE = 8000.0
N = 3000
HEADING = "time [s],force [N],acceleration [m/s^2]"


def make_hits(count: int, seed: int = 0) -> np.ndarray:
    """Hits of one structure, shape (count, 2, N): force (N) and acceleration (m/s^2)."""
    random, structure = np.random.default_rng(seed), Structure(np.array([400.0]), np.array([0.05]), np.array([2e7]))
    time, width, hits = np.arange(N) / RATE, 1e-3, []
    for peak, start in zip(random.uniform(100, 300, count), random.uniform(0.01, 0.02, count), strict=True):
        since = time - start
        force = np.where((since >= 0) & (since < width), peak * np.sin(np.pi * since / width) ** 4, 0.0)
        response = np.where(since >= 0, peak * structure.response(np.maximum(since, 0), width), 0.0)
        hits.append(np.stack([force, response]) + 0.02 * random.normal(size=(2, N)))
    return np.array(hits)


def put_hit(path: Path, hit: np.ndarray, heading: str = HEADING, rate: float = RATE) -> Path:
    """Write the channels of a hit as columns behind the time."""
    columns = np.column_stack([np.arange(hit.shape[-1]) / rate, *hit])
    np.savetxt(path, columns, "%.12g", ",", header=heading, comments="")
    return path
