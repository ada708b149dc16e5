"""Published cutting-force coefficients, and their lookup by material name.

A material of materials.csv has the specific forces of its VDI 3323 group, of its CMC code and of its own name in
specific_cutting_forces.csv, and the ratio Kr/Kt of force_ratios.csv of its VDI 3323 group, else of its ISO 513 group.
"""

import csv
import difflib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from lobes.coefficient_distribution import JointCoefficients, Quantiles, pool_intervals
from lobes.coefficients import CuttingCoefficients, SpecificForce


@cache
def read_table(name: str) -> tuple[dict[str, str], ...]:
    """Return the rows of a .csv file of this package."""
    return tuple(csv.DictReader((files("lobes") / name).read_text(encoding="utf-8").splitlines()))


@cache
def milling_tests() -> tuple[CuttingCoefficients, ...]:
    """Return the coefficients measured by milling, with the range over the tests of the same alloy."""
    tests = [_read_test(row) for row in read_table("cutting_coefficients.csv")]
    return tuple(_with_range(test, [other for other in tests if other.alloy == test.alloy]) for test in tests)


def _read_test(row: dict[str, str]) -> CuttingCoefficients:
    return CuttingCoefficients(
        material=row["material"],
        tangential=float(row["Ktc_MPa"]) * 1e6,
        radial=float(row["Krc_MPa"]) * 1e6,
        tangential_edge=float(row["Kte_N_per_mm"] or "nan") * 1e3,
        radial_edge=float(row["Kre_N_per_mm"] or "nan") * 1e3,
        note=row["note"],
        source=row["source"],
        alloy=row["alloy"],
        iso_group=row["iso_group"],
    )


def _with_range(test: CuttingCoefficients, alike: Sequence[CuttingCoefficients]) -> CuttingCoefficients:
    if len(alike) == 1:
        return test
    tangential = [other.tangential for other in alike]
    ratio = [other.radial / other.tangential for other in alike]
    return replace(test, tangential_range=(min(tangential), max(tangential)), ratio_range=(min(ratio), max(ratio)))


REFERENCE_CHIP_THICKNESS = 1e-4
"""Chip thickness of the stated Kt and Kte (m)."""
CHIP_THICKNESS_RANGE = (0.5e-4, 2e-4)
"""Chip thicknesses of the range of Kt (m): mills with 0.05 to 0.3 mm per tooth."""
MIN_COEFFICIENT_RANGE = 0.25
"""Least relative half-width of the range of Kt, the error of a single source."""


@cache
def listed_materials() -> tuple[CuttingCoefficients, ...]:
    """Return the materials listed by name, in the order of ISO 513."""
    return tuple(_material_coefficients(row) for row in read_table("materials.csv"))


class MaterialSources(NamedTuple):
    """Sources of a listed material."""

    forces: list[SpecificForce]
    """Specific forces of its VDI 3323 group, its CMC code and its own name."""
    tests: list[CuttingCoefficients]
    """Milling tests of its alloy."""
    ratio: dict[str, str]
    """Row of force_ratios.csv."""

    @property
    def tangential(self) -> float:
        """Mean Kt of the publications at the stated chip thickness (Pa)."""
        of_tests = [test.tangential for test in self.tests]
        return float(np.mean([force.tangential(REFERENCE_CHIP_THICKNESS) for force in self.forces] + of_tests))

    @property
    def tangential_edge(self) -> float:
        """Mean Kte of the publications (N/m)."""
        edges = [force.tangential_edge(REFERENCE_CHIP_THICKNESS) for force in self.forces]
        return float(np.mean(edges + [test.tangential_edge for test in self.tests]))


def _specific_forces(name: str) -> list[SpecificForce]:
    rows = [row for row in read_table("specific_cutting_forces.csv") if row["of"] == name]
    return [SpecificForce(float(row["kc1.1_N_per_mm2"]) * 1e6, float(row["mc"]), row["source"]) for row in rows]


def _material_sources(row: dict[str, str]) -> MaterialSources:
    vdi, cmc = f"VDI {row['vdi_3323_group']}", f"CMC {row['cmc_code']}"
    forces = [force for name in (vdi, cmc, row["material"]) for force in _specific_forces(name)]
    tests = [test for test in milling_tests() if row["alloy"] and test.alloy == row["alloy"]]
    ratios = {each["of"]: each for each in read_table("force_ratios.csv")}
    return MaterialSources(forces, tests, ratios.get(vdi) or ratios[row["iso_group"]])


def _material_coefficients(row: dict[str, str]) -> CuttingCoefficients:
    sources, joint = _material_sources(row), _distributions()[row["material"]]
    ranges = [(float(each.values[0]), float(each.values[-1])) for each in (joint.tangential, joint.ratio)]
    return CuttingCoefficients(
        material=row["material"],
        tangential=sources.tangential,
        radial=sources.tangential * float(sources.ratio["middle"]),
        tangential_edge=sources.tangential_edge,
        source="; ".join(_source_texts(sources, joint.correlation)),
        alloy=row["alloy"],
        iso_group=row["iso_group"],
        vdi_3323_group=row["vdi_3323_group"],
        equivalents=tuple(row["equivalents"].split(";")),
        tangential_range=ranges[0],
        ratio_range=ranges[1],
        specific_forces=tuple(sources.forces),
    )


def find_joint_coefficients(known: CuttingCoefficients) -> JointCoefficients | None:
    """Find the joint distribution of Kt (Pa) and Kr/Kt by the sources of a listed material.

    Parameters
    ----------
    known : CuttingCoefficients
        Coefficients.

    Returns
    -------
    JointCoefficients or None
        Distribution; None for other materials, and for coefficients of the user.
    """
    return _distributions()[known.material] if known.specific_forces else None


@cache
def _distributions() -> dict[str, JointCoefficients]:
    """Return the joint distribution of Kt and Kr/Kt of each listed material by its name."""
    sources = {row["material"]: _material_sources(row) for row in read_table("materials.csv")}
    return {name: JointCoefficients(_pool_forces(each), _ratio_quantiles(each)) for name, each in sources.items()}


def _pool_forces(sources: MaterialSources) -> Quantiles:
    """Pool Kt (Pa): each publication over the chip thicknesses, each test, and the error of a single source."""
    thin, thick = CHIP_THICKNESS_RANGE
    published = [(force.tangential(thick), force.tangential(thin)) for force in sources.forces]
    tests = [(test.tangential, test.tangential) for test in sources.tests]
    error = [(1 + side * MIN_COEFFICIENT_RANGE) * sources.tangential for side in (-1, 1)]
    return pool_intervals([*published, *tests, (error[0], error[1])])


def _ratio_quantiles(sources: MaterialSources) -> Quantiles:
    """Return the quantiles of Kr/Kt: as likely below as above the published one, evenly on either side."""
    values = [float(sources.ratio[name]) for name in ("low", "middle", "high")]
    return Quantiles(np.array([0.0, 0.5, 1.0]), np.array(values))


def _source_texts(sources: MaterialSources, correlation: float) -> list[str]:
    """Return one source per number: kc1.1 with mc, tests, Kr/Kt, correlation."""
    of_forces = [
        f"kc1.1 {force.at_1_mm / 1e6:.0f}, mc {force.exponent:.2f}: {force.source}" for force in sources.forces
    ]
    of_tests = [f"Kt {test.tangential / 1e6:.0f}: {test.source}" for test in sources.tests]
    joint = f"rank correlation of Kt and Kr/Kt {correlation:g}: four tests of Al 7075 in cutting_coefficients.csv"
    return [*of_forces, *of_tests, f"Kr/Kt: {sources.ratio['source']}", joint]


def all_cutting_coefficients() -> tuple[CuttingCoefficients, ...]:
    """Return all published coefficients: those measured by milling, then the materials listed by name.

    The listed ones follow from published specific cutting forces. Each names its source.

    Returns
    -------
    tuple of CuttingCoefficients
        All coefficients of this package.
    """
    return (*milling_tests(), *listed_materials())


NUMBERED_NAME = re.compile(r"(?:AISI|AA) (\d\w+)")
"""Name by a standard whose number is used alone, such as AISI 4140."""
MATERIAL_GROUPS = {
    "steel": ("P", ""),
    "stainlesssteel": ("M", ""),
    "castiron": ("K", ""),
    "aluminium": ("N", "^EN A"),
    "aluminum": ("N", "^EN A"),
    "brass": ("N", "^CuZn"),
    "titanium": ("S", "^Ti"),
    "hardenedsteel": ("H", "hardened"),
}
"""ISO 513 group and pattern of the listed names of a group of materials, by its folded English name."""


def fold_material_name(name: str) -> str:
    """Fold a material name: case and blanks do not count.

    Parameters
    ----------
    name : str
        Name as written.

    Returns
    -------
    str
        Folded name.

    Examples
    --------
    >>> fold_material_name("Al 7075-T6") == fold_material_name("AL7075-t6")
    True
    """
    return "".join(name.split()).casefold()


@cache
def materials_by_name() -> Mapping[str, CuttingCoefficients]:
    """Return the coefficients by each of their folded names.

    Returns
    -------
    mapping of str to CuttingCoefficients
        Coefficients by the result of `fold_material_name`.

    Examples
    --------
    >>> materials_by_name()[fold_material_name("AA 7075")].names
    ('EN AW-7075', '3.4365', 'AlZn5.5MgCu', 'AlZnMgCu1.5', 'AA 7075', 'UNS A97075')
    """
    known = [(name, material) for material in all_cutting_coefficients() for name in material.names]
    by_name = {fold_material_name(name): material for name, material in known}
    short = [(match[1], material) for name, material in known if (match := NUMBERED_NAME.fullmatch(name))]
    counts = Counter(number for number, _ in short)
    unique = {fold_material_name(number): material for number, material in short if counts[number] == 1}
    return MappingProxyType(unique | by_name)


def explain_unknown_material(name: str, by_name: Mapping[str, CuttingCoefficients]) -> str:
    """Return the names to choose from for an unknown name, such as "steel", as a sentence.

    Parameters
    ----------
    name : str
        Unknown name.
    by_name : mapping of str to CuttingCoefficients
        Coefficients by folded names.

    Returns
    -------
    str
        Question with the most similar published name, or the names of a group.

    Examples
    --------
    >>> explain_unknown_material("titanium", materials_by_name())
    'Choose one of Ti Grade 2, TiAl6V4.'
    >>> explain_unknown_material("AA 7057", materials_by_name())
    "Did you mean 'AA 7075'?"
    """
    group, pattern = MATERIAL_GROUPS.get(fold_material_name(name), ("", ""))
    listed = [material for material in listed_materials() if material.iso_group == group]
    names = [material.material for material in listed if re.search(pattern, material.material)]
    return f"Choose one of {', '.join(names)}." if names else f"Did you mean {_nearest_material_name(name, by_name)!r}?"


def _nearest_material_name(name: str, by_name: Mapping[str, CuttingCoefficients]) -> str:
    """Return the published name that is most similar to an unknown one."""
    nearest = difflib.get_close_matches(fold_material_name(name), by_name, n=1, cutoff=0.0)[0]
    return next((known for known in by_name[nearest].names if fold_material_name(known) == nearest), nearest)


def find_materials(word: str) -> list[CuttingCoefficients]:
    """Find materials by ISO 513 group (one letter) or by a part of a name. Case and blanks do not count.

    Parameters
    ----------
    word : str
        Group or part of a name; "" finds all.

    Returns
    -------
    list of CuttingCoefficients
        Matching materials.

    Raises
    ------
    ValueError
        If none matches.

    Examples
    --------
    >>> sorted({material.alloy for material in find_materials("7075")})
    ['Al 7075']
    >>> len(find_materials("N")) >= 10  # group N of ISO 513: non-ferrous
    True
    """
    folded, known = fold_material_name(word), all_cutting_coefficients()
    in_group = [material for material in known if folded and material.iso_group.casefold() == folded]
    matching = in_group or [m for m in known if any(folded in fold_material_name(name) for name in m.names)]
    if not matching:
        near = _nearest_material_name(word, materials_by_name())
        raise ValueError(f"no material name contains {word!r}. Did you mean {near!r}?")
    return matching
