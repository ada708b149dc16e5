"""Tables of one FRF and one hit in several layouts, and the questions they raise."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition import Description, Frf, inspect_file

F = np.arange(1.0, 60.0)
H = 1e-6 / (1 + 0.1j * F)
TIME = np.arange(400) / 4000
FORCE = np.where(np.abs(TIME - 0.005) < 2e-3, 100 * np.cos(np.pi * (TIME - 0.005) / 4e-3) ** 2, 0.0)
RESPONSE = np.where(TIME > 0.005, np.exp(-200 * (TIME - 0.005)) * np.sin(2000 * TIME), 0.0)

HIT = [f"{t:.9g} {f:.9g} {a:.9g} 20".split() for t, f, a in zip(TIME, FORCE, RESPONSE, strict=True)]
"""The hit and a temperature, cell by cell."""


def numeral(value: float, decimal: str, thousands: str) -> str:
    return f"{value:,.7f}".translate(str.maketrans(",.", thousands + decimal))


def rows(*columns: np.ndarray, form: str = "%.12g", separator: str = "\t", end: str = "\n") -> str:
    return "".join(separator.join(form % value for value in row) + end for row in zip(*columns, strict=True))


def put(path: Path, text: str) -> Path:
    path.write_text(text, encoding="latin-1", newline="")
    return path


def complaint(path: Path, **said: object) -> str:
    return inspect_file(path, Description(**said)).problems  # type: ignore[arg-type]


def is_h(frf: Frf) -> bool:
    return np.allclose(frf.receptance, H, rtol=1e-6, atol=0) and np.allclose(frf.frequency, F)
