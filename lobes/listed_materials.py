"""Materials by name, with cutting coefficients from published specific cutting forces (the .csv beside this module).

A material of materials.csv has the specific forces of its group of VDI 3323, of its CMC code and of its own name in
specific_cutting_forces.csv, and the ratio Kr/Kt of force_ratios.csv of its group of VDI 3323, else of ISO 513.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

import numpy as np

from lobes.coefficients import Coefficients
from lobes.milling_tests import milling_tests
from lobes.specific_force import SpecificForce

CHIP = 1e-4
"""Chip thickness that Kt and Kte are said at (m) ..."""
CHIPS = (0.5e-4, 2e-4)
"""... and those that their range reaches over: of mills with 0.05 to 0.3 mm a tooth."""
LEAST = 0.25
"""Least half-width of the range of Kt: what one source is taken to be off by."""


@cache
def listed_materials() -> tuple[Coefficients, ...]:
    """All that come with this package, in the order of ISO 513."""
    return tuple(_material(row) for row in _rows("materials.csv"))


def _rows(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader((files("lobes") / name).read_text(encoding="utf-8").splitlines()))


@cache
def _specific_forces() -> dict[str, list[SpecificForce]]:
    """By what they are of."""
    by_name: dict[str, list[SpecificForce]] = {}
    for row in _rows("specific_cutting_forces.csv"):
        force = SpecificForce(float(row["kc1.1_N_per_mm2"]) * 1e6, float(row["mc"]), row["source"])
        by_name.setdefault(row["of"], []).append(force)
    return by_name


@cache
def _ratios() -> dict[str, dict[str, str]]:
    return {row["of"]: row for row in _rows("force_ratios.csv")}


def _material(row: dict[str, str]) -> Coefficients:
    vdi, cmc = f"VDI {row['vdi_3323_group']}", f"CMC {row['cmc_code']}"
    forces = [force for name in (vdi, cmc, row["material"]) for force in _specific_forces().get(name, ())]
    tests = [test for test in milling_tests() if row["alloy"] and test.alloy == row["alloy"]]
    ratio = _ratios().get(vdi) or _ratios()[row["iso_group"]]
    tangential = np.mean([force.tangential(CHIP) for force in forces] + [test.tangential for test in tests])
    edge = np.mean([force.tangential_edge(CHIP) for force in forces] + [test.tangential_edge for test in tests])
    return Coefficients(
        material=row["material"],
        tangential=float(tangential),
        radial=float(tangential) * float(ratio["middle"]),
        tangential_edge=float(edge),
        source="; ".join(_sources(forces, tests, ratio["source"])),
        alloy=row["alloy"],
        iso_group=row["iso_group"],
        vdi_3323_group=row["vdi_3323_group"],
        equivalents=tuple(row["equivalents"].split(";")),
        tangential_range=_range(float(tangential), forces, tests),
        ratio_range=(float(ratio["low"]), float(ratio["high"])),
        specific_forces=tuple(forces),
    )


def _range(middle: float, forces: Sequence[SpecificForce], tests: Sequence[Coefficients]) -> tuple[float, float]:
    """Over all publications and chip thicknesses."""
    published = [force.tangential(chip) for force in forces for chip in CHIPS] + [test.tangential for test in tests]
    return min(*published, (1 - LEAST) * middle), max(*published, (1 + LEAST) * middle)


def _sources(forces: Sequence[SpecificForce], tests: Sequence[Coefficients], ratio: str) -> list[str]:
    """One a number: kc1.1 with mc, tests, Kr/Kt."""
    of_forces = [f"kc1.1 {force.at_1_mm / 1e6:.0f}, mc {force.exponent:.2f}: {force.source}" for force in forces]
    return [*of_forces, *(f"Kt {test.tangential / 1e6:.0f}: {test.source}" for test in tests), f"Kr/Kt: {ratio}"]
