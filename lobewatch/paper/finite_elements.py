"""Finite-element validation of the paper, repeated with textbook elements."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from dsm import Spindle
from dsm.arrays import Floats
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup, format_share

ElementKind = Literal["euler-bernoulli", "timoshenko", "linear"]
"""Kind of element: Hermite cubics without shear; cubics of Timoshenko theory; linear with shear, as BEAM188."""

BearingKind = Literal["springs", "rigid", "clamped"]
"""Support by the bearings: springs, held deflection, or held deflection and slope."""


def first_frequency(spindle: Spindle, elements: int, kind: ElementKind, bearings: BearingKind = "springs") -> float:
    """Return the lowest bending frequency (Hz) of so many elements, distributed over the segments by length.

    Bearings are springs at the nodes, or hold the deflection, clamped ones the rotation too. Consistent mass, with
    rotary inertia if there is shear. Linear elements have their strain from the middle only, otherwise they would
    lock. Segments are uniform, and bearings are at their ends. Raises ValueError for fewer elements than segments.

    Source: J. S. Przemieniecki, Theory of Matrix Structural Analysis, 1968, ch. 5 and 11; T. J. R. Hughes, The Finite
    Element Method, 1987, ch. 5.4 (linear elements).
    """
    from scipy.linalg import eigh  # takes longer to import than what it solves

    length, section = _mesh(spindle, elements)
    stiffness, mass = (_assemble_elements(part) for part in _matrices(length, section, kind))
    nodes = np.concatenate(([0.0], np.cumsum(length)))
    places = [2 * int(np.argmin(np.abs(nodes - bearing.position))) for bearing in spindle.bearings]
    if bearings != "springs":
        held = places + [place + 1 for place in places] if bearings == "clamped" else places
        free = np.setdiff1d(np.arange(2 * nodes.size), held)
        stiffness, mass = stiffness[np.ix_(free, free)], mass[np.ix_(free, free)]
    else:
        stiffness[places, places] += [bearing.stiffness for bearing in spindle.bearings]
    last = len(mass) - 1
    inverse = eigh(mass, stiffness, eigvals_only=True, subset_by_index=[last, last])  # of 1/w^2: the lowest is exact
    return float(1 / np.sqrt(inverse[0]) / (2 * np.pi))


def _mesh(spindle: Spindle, elements: int) -> tuple[Floats, Floats]:
    """Return element lengths (m), and EI (N m^2), kappa GA (N), mass per length (kg/m), rho I (kg m), shape (4, n)."""
    if elements < len(spindle.segments):
        cure = "Give at least one element for each segment."
        raise ValueError(f"elements={elements} is less than the {len(spindle.segments)} segments. {cure}")
    length, outer, bore = np.array([(s.length, s.outer_diameter, s.bore_diameter) for s in spindle.segments]).T
    count = np.ones(length.size, dtype=int)
    for _ in range(elements - length.size):
        count[np.argmax(length / count)] += 1
    area, moment = np.pi * (outer**2 - bore**2) / 4, np.pi * (outer**4 - bore**4) / 64
    steel = spindle.material
    ratio = steel.youngs_modulus / (2 * steel.shear_modulus) - 1
    shear = _cowper(ratio, bore / outer) * steel.shear_modulus * area
    section = np.array([steel.youngs_modulus * moment, shear, steel.density * area, steel.density * moment])
    return np.repeat(length / count, count), np.repeat(section, count, axis=1)


def _cowper(poisson: float, bore: Floats) -> Floats:
    """Return the shear coefficient of a ring, bore over outer diameter (G. R. Cowper, J. Appl. Mech. 33, 1966)."""
    square = (1 + bore**2) ** 2
    return np.asarray(6 * (1 + poisson) * square / ((7 + 6 * poisson) * square + (20 + 12 * poisson) * bore**2))


def _matrices(length: Floats, section: Floats, kind: ElementKind) -> tuple[Floats, Floats]:
    """Return stiffness and mass of each element, shape (n, 4, 4): deflection and rotation at its two ends."""
    rigidity, shear, mass, rotary = section
    point, weight = np.polynomial.legendre.leggauss(4)
    everywhere = list(zip((1 + point) / 2, weight / 2, strict=True))
    softness = 12 * rigidity / (shear * length**2) if kind == "timoshenko" else np.zeros(length.size)
    stiff, heavy = np.zeros((length.size, 4, 4)), np.zeros((length.size, 4, 4))
    for x, share in [(0.5, 1.0)] if kind == "linear" else everywhere:
        bend, slide = _strains(x, length, softness, kind)
        stiff += _weighted_square(bend, share * length * rigidity)
        if kind != "euler-bernoulli":
            stiff += _weighted_square(slide, share * length * shear)
    for x, share in everywhere:
        deflection, rotation = _shapes(x, length, softness, kind)
        heavy += _weighted_square(deflection, share * length * mass)
        if kind != "euler-bernoulli":
            heavy += _weighted_square(rotation, share * length * rotary)
    return stiff, heavy


def _shapes(x: float, length: Floats, softness: Floats, kind: ElementKind) -> tuple[Floats, Floats]:
    """Return deflection and rotation at x (0 to 1) for each end value, shape (4, n)."""
    one, none = np.ones(length.size), np.zeros(length.size)
    if kind == "linear":
        return np.array([(1 - x) * one, none, x * one, none]), np.array([none, (1 - x) * one, none, x * one])
    bump = x - x**2
    near = 1 - 3 * x**2 + 2 * x**3 + softness * (1 - x), length * (x - 2 * x**2 + x**3 + softness * bump / 2)
    far = 3 * x**2 - 2 * x**3 + softness * x, length * (x**3 - x**2 - softness * bump / 2)
    deflection = np.array([*near, *far])
    ends = 1 - 4 * x + 3 * x**2 + softness * (1 - x), 3 * x**2 - 2 * x + softness * x
    rotation = np.array([-6 * bump / length, ends[0], 6 * bump / length, ends[1]])
    return deflection / (1 + softness), rotation / (1 + softness)


def _strains(x: float, length: Floats, softness: Floats, kind: ElementKind) -> tuple[Floats, Floats]:
    """Return curvature (1/m) and shear strain at x for each end value, shape (4, n)."""
    one, none = np.ones(length.size), np.zeros(length.size)
    if kind == "linear":
        rotation = _shapes(x, length, softness, kind)[1]
        return np.array([none, -one, none, one]) / length, np.array([-one, none, one, none]) / length - rotation
    turn = 1 - 2 * x
    bend = [-6 * turn / length, 6 * x - 4 - softness, 6 * turn / length, 6 * x - 2 + softness]
    curvature = np.array(bend) / (length * (1 + softness))
    slide = softness / (1 + softness) * np.array([-1 / length, -one / 2, 1 / length, -one / 2])
    return curvature, slide


def _weighted_square(shape: Floats, weight: Floats) -> Floats:
    return np.asarray(np.einsum("in,jn,n->nij", shape, shape, weight))


def _assemble_elements(parts: Floats) -> Floats:
    """Assemble all elements in a row, shape (2 n + 2, 2 n + 2)."""
    whole = np.zeros((2 * len(parts) + 2, 2 * len(parts) + 2))
    for i, part in enumerate(parts):
        whole[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += part
    return whole


ELEMENT_COUNTS = (26, 39, 52, 77, 110, printed.FEM_ELEMENTS, 220, 308)
"""Numbers of elements: one per segment, the paper's, twice the paper's, and between."""


class FiniteElementStudy(NamedTuple):
    """First natural frequency with rigid bearings by finite elements."""

    exact: Mapping[ElementKind, float]
    """Frequency of the exact model of the same beam theory (Hz)."""
    frequencies: Mapping[ElementKind, tuple[float, ...]]
    """Frequency for each of `ELEMENT_COUNTS` (Hz)."""
    clamped: float
    """Frequency with shear and bearings that hold the slope too (Hz)."""

    def error(self, kind: ElementKind, elements: int = printed.FEM_ELEMENTS) -> float:
        """Return the relative error of the frequency of so many elements."""
        return self.at(kind, elements) / self.exact[kind] - 1

    def at(self, kind: ElementKind, elements: int = printed.FEM_ELEMENTS) -> float:
        """Return the frequency of so many elements (Hz)."""
        return self.frequencies[kind][ELEMENT_COUNTS.index(elements)]


def study_meshes(plain: Spindle, shear: Spindle, exact: tuple[float, float]) -> FiniteElementStudy:
    """Compare elements with the exact first frequency (Hz) by Euler-Bernoulli (plain) and Timoshenko theory (shear)."""
    exacts: Mapping[ElementKind, float] = {"euler-bernoulli": exact[0], "timoshenko": exact[1], "linear": exact[1]}
    frequencies = {}
    for kind in exacts:
        spindle = plain if kind == "euler-bernoulli" else shear
        frequencies[kind] = tuple(first_frequency(spindle, count, kind, "rigid") for count in ELEMENT_COUNTS)
    clamped = first_frequency(shear, printed.FEM_ELEMENTS, "timoshenko", "clamped")
    return FiniteElementStudy(exacts, frequencies, clamped)


def mesh_section(study: FiniteElementStudy) -> NumberGroup:
    """Return the numbers of the validation."""
    plain, cubic, straight = (study.at(kind) for kind in study.exact)
    above = round((printed.FEM_FREQUENCY / printed.RIGID_FREQUENCY - 1) * 100, 2)
    ours = (straight / study.exact["euler-bernoulli"] - 1) * 100
    off = {kind: f"{format_share(study.error(kind), '+')} off exact theory" for kind in study.exact}
    mesh = f"linear with shear, the default of BEAM188: {off['linear']}, so neither shear nor mesh explains 2367 Hz"
    softer = "shear and rotary inertia lower f1, so f1 of a model with both effects is never higher"
    apart = f"same number of elements, {off['euler-bernoulli']}, computed by code independent of the model"
    name = f"{printed.FEM_ELEMENTS} elements"
    held = f"clamped in all bearings, the stiffest support: still below {printed.FEM_FREQUENCY:.0f} Hz"
    numbers = (
        Comparison(f"f1, {name}", "", printed.FEM_FREQUENCY, straight, "Hz", 6, mesh),
        Comparison("excess over f1 of the model", "", above, ours, "%", 3, softer),
        Comparison("f1, cubic without shear", "", None, plain, "Hz", 7, apart),
        Comparison("f1, cubic with shear", "", None, cubic, "Hz", 7, f"same number of elements, {off['timoshenko']}"),
        Comparison("f1, cubic with shear, clamped", "", None, study.clamped, "Hz", 6, held),
    )
    return NumberGroup("Finite elements, rigid bearings", ("convergence",), numbers)
