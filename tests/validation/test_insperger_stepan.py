"""Semi-discretisation against exact Floquet multipliers and stability limits.

T. Insperger, G. Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, and Y. Ding et al., Int. J. Machine
Tools and Manufacture 50 (2010) 502-509: the milling benchmark m = 0.03993 kg, 922 Hz, zeta 0.011, Kt 6e8, Kn 2e8 N/m^2,
two teeth. Exact numbers: tests/data/milling_stability/SOURCE.txt.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from lobes import Cut, spectral_radius, stability_boundary
from modal import Mode

DATA = Path(__file__).parents[1] / "data" / "milling_stability"
MODES = [Mode(922.0, 0.011, 0.03993 * (2 * math.pi * 922) ** 2)]

Row = dict[str, str]


def table(name: str) -> list[Row]:
    lines = (DATA / name).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


FLOQUET = table("floquet_reference.csv")
CROSSINGS = table("stability_boundary_reference.csv")


def cut(row: Row) -> Cut:
    return Cut(2, float(row["a_over_D"]), "up" if row["mode"] == "up" else "down", 6e8, 2e8)


def radius(row: Row) -> float:
    y = MODES if row["dof"] == "2" else None
    return float(spectral_radius(MODES, y, cut(row), float(row["rpm"]), float(row["w_mm"]) / 1e3)[0, 0])


def test_the_tables_are_whole() -> None:
    assert (len(FLOQUET), len(CROSSINGS)) == (90, 20)


@pytest.mark.parametrize(
    "row", FLOQUET, ids=lambda r: f"{r['dof']}, {r['mode']} {r['a_over_D']}, {r['rpm']}, {r['w_mm']}"
)
def test_multipliers_are_exact(row: Row) -> None:
    assert radius(row) == pytest.approx(float(row["mu_exact"]), rel=3e-4)


@pytest.mark.parametrize("row", CROSSINGS, ids=lambda r: f"a/D {r['a_over_D']}, {r['rpm']} rpm, {r['crossing']}")
def test_crossings(row: Row) -> None:
    speed, number = float(row["rpm"]), int(row["crossing"])
    found = stability_boundary(MODES, None, cut(row), speed, 10e-3)
    wanted = [r for r in CROSSINGS if (r["a_over_D"], r["rpm"]) == (row["a_over_D"], row["rpm"])]
    assert np.isfinite(found.crossings[0]).sum() == len(wanted)
    assert found.crossings[0, number - 1] * 1e3 == pytest.approx(float(row["w_mm"]), rel=1e-4)
    if number > 1:
        return
    assert found.depth[0] == found.crossings[0, 0]
    assert found.kind[0] == row["type"]
    tooth = 2 * speed / 60
    base = found.chatter_frequency[0] % tooth
    assert min(base, tooth - base) == pytest.approx(float(row["base_freq_hz"]), abs=0.2)
    assert 0.8 * 922 < found.chatter_frequency[0] < 1.4 * 922


@pytest.mark.parametrize(
    ("speed", "depth_mm"), [(4000.0, 1.4818), (7000.0, 1.4178), (10000.0, 1.3650), (13000.0, 5.2100)]
)
def test_two_directions_of_weck_altintas_budak(speed: float, depth_mm: float) -> None:
    """Half immersion, three teeth, 603 and 666 Hz; first crossings by exact Floquet theory."""
    x, y = [Mode(603.0, 0.039, 5.59e6)], [Mode(666.0, 0.035, 5.715e6)]
    found = stability_boundary(x, y, Cut(3, 0.5, "up", 6e8, 0.42e8), speed, 10e-3)
    assert found.depth[0] * 1e3 == pytest.approx(depth_mm, rel=2e-3)
