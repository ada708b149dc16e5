"""Everything that is compared with the paper, from one run."""

from __future__ import annotations

from dataclasses import dataclass

from lobewatch.paper.claims import claims
from lobewatch.paper.comparison import Claim, NumberGroup
from lobewatch.paper.element_study import ElementStudy, element_section, study_element
from lobewatch.paper.fe_study import FiniteElementStudy, mesh_section, study_meshes
from lobewatch.paper.lobe_study import LobeStudy, lobe_section, study_lobes
from lobewatch.paper.shaft_study import ShaftStudy, shaft_sections, study_shaft
from lobewatch.paper.stiffness_study import StiffnessStudy, stiffness_section, study_stiffness
from lobewatch.paper.tap_study import TapStudy, study_tap, tap_section


@dataclass(frozen=True, eq=False)
class PaperStudy:
    """What was computed for the comparison."""

    plain: ShaftStudy
    """Shaft by Euler-Bernoulli theory, the paper's."""
    shear: ShaftStudy
    """Shaft by Timoshenko theory."""
    meshes: FiniteElementStudy
    """Finite elements."""
    element: ElementStudy
    """Spinning element as printed."""
    tap: TapStudy
    """Tap test."""
    stiffness: StiffnessStudy
    """Tip stiffness, new and old."""
    lobes: LobeStudy
    """Stability lobes, new and old."""

    @property
    def sections(self) -> tuple[NumberGroup, ...]:
        """Every number of the paper beside ours, in the order of the paper."""
        at_rest, spinning = shaft_sections(self.plain, self.shear)
        return (
            element_section(self.element),
            at_rest,
            mesh_section(self.meshes),
            spinning,
            tap_section(self.tap),
            stiffness_section(self.stiffness),
            lobe_section(self.lobes),
        )

    @property
    def claims(self) -> tuple[Claim, ...]:
        """What the paper claims, and whether it holds."""
        return claims(self.plain, self.shear, self.meshes, self.stiffness, self.lobes)


def study_paper() -> PaperStudy:
    """All of it on the packaged surrogate: about a second of CPU."""
    plain, shear = study_shaft("euler-bernoulli"), study_shaft("timoshenko")
    tap = study_tap(plain.new.spindle)
    stiffness = study_stiffness(plain.old)
    return PaperStudy(
        plain,
        shear,
        study_meshes(plain.rigid, shear.rigid, (plain.rigid_frequency, shear.rigid_frequency)),
        study_element(plain.rigid),
        tap,
        stiffness,
        study_lobes(tap.measured, stiffness.modal[1] / stiffness.modal[0], tap.surrogate_modes),
    )
