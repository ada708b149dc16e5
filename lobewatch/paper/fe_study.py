"""The finite-element validation of the paper, repeated with textbook elements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dsm import Spindle
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup, share_text
from lobewatch.paper.finite_elements import ElementKind, first_frequency

ELEMENTS = (26, 39, 52, 77, 110, printed.FEM_ELEMENTS, 220, 308)
"""Numbers of elements: one a segment, the paper's, twice the paper's, and between."""


@dataclass(frozen=True, eq=False)
class FiniteElementStudy:
    """First natural frequency with rigid bearings by finite elements."""

    exact: Mapping[ElementKind, float]
    """Frequency of the exact model of the same beam theory (Hz)."""
    frequencies: Mapping[ElementKind, tuple[float, ...]]
    """Frequency for each of `ELEMENTS` (Hz)."""
    clamped: float
    """Frequency with shear where the bearings hold the slope too (Hz)."""

    def error(self, kind: ElementKind, elements: int = printed.FEM_ELEMENTS) -> float:
        """Share by which so many elements lie above the exact frequency."""
        return self.at(kind, elements) / self.exact[kind] - 1

    def at(self, kind: ElementKind, elements: int = printed.FEM_ELEMENTS) -> float:
        """Frequency with so many elements (Hz)."""
        return self.frequencies[kind][ELEMENTS.index(elements)]


def study_meshes(plain: Spindle, shear: Spindle, exact: tuple[float, float]) -> FiniteElementStudy:
    """Elements against the exact first frequency (Hz) by Euler-Bernoulli (plain) and by Timoshenko theory (shear)."""
    exacts: Mapping[ElementKind, float] = {"euler-bernoulli": exact[0], "timoshenko": exact[1], "linear": exact[1]}
    return FiniteElementStudy(
        exacts,
        {
            kind: tuple(
                first_frequency(plain if kind == "euler-bernoulli" else shear, count, kind, "rigid")
                for count in ELEMENTS
            )
            for kind in exacts
        },
        first_frequency(shear, printed.FEM_ELEMENTS, "timoshenko", "clamped"),
    )


def mesh_section(study: FiniteElementStudy) -> NumberGroup:
    """Numbers of the validation."""
    plain, cubic, straight = (study.at(kind) for kind in study.exact)
    above = round((printed.FEM_FREQUENCY / printed.RIGID_FREQUENCY - 1) * 100, 2)
    ours = (straight / study.exact["euler-bernoulli"] - 1) * 100
    off = {kind: f"{share_text(study.error(kind), '+')} off exact theory" for kind in study.exact}
    mesh = f"straight lines with shear, as BEAM188 has by default: {off['linear']}, so 2367 is neither shear nor mesh"
    softer = "shear and rotary inertia soften: a model that has them lies below the one that has not, never above"
    apart = f"as many, {off['euler-bernoulli']}: by a code that shares nothing with the model"
    name = f"{printed.FEM_ELEMENTS} elements"
    held = "clamped in all bearings, the stiffest way to hold it: still below"
    return NumberGroup(
        "Finite elements, rigid bearings",
        ("convergence",),
        (
            Comparison(f"f_1, {name}", "", printed.FEM_FREQUENCY, straight, "Hz", 6, mesh),
            Comparison("it is above f_1 of the model by", "", above, ours, "%", 3, softer),
            Comparison("f_1, cubics without shear", "", None, plain, "Hz", 7, apart),
            Comparison("f_1, cubics with shear", "", None, cubic, "Hz", 7, f"as many, {off['timoshenko']}"),
            Comparison("the same, slopes held too", "", None, study.clamped, "Hz", 6, held),
        ),
    )
