"""Comparison with the paper from one run: all numbers and claims."""

from dataclasses import dataclass

from lobewatch.paper import printed, shaft_study
from lobewatch.paper.comparison import Claim, NumberGroup, format_share
from lobewatch.paper.element_study import element_section
from lobewatch.paper.finite_elements import FiniteElementStudy, mesh_section, study_meshes
from lobewatch.paper.lobe_study import LobeStudy, lobe_section, study_lobes
from lobewatch.paper.tap_study import TapStudy, study_tap, tap_section


def _validation_claim(meshes: FiniteElementStudy) -> Claim:
    softer = meshes.exact["timoshenko"] / meshes.exact["euler-bernoulli"] - 1
    return Claim(
        "Finite elements with shear validate the model without it: 2367 against 2303 Hz, less than 3 % apart.",
        "fails",
        f"Shear takes {format_share(-softer)} off f_1 of this shaft, and {printed.FEM_ELEMENTS} elements are exact to "
        f"{format_share(meshes.error('linear'))}. With shear f_1 lies below that without it, even clamped in all "
        f"bearings ({meshes.clamped:.0f} Hz): a model with shear that lies above is another shaft, and how little "
        "above says nothing.",
    )


def _bearing_claims(plain: shaft_study.ShaftStudy, shear: shaft_study.ShaftStudy) -> tuple[Claim, Claim]:
    high, sheared = plain.rigid_frequency / printed.FREQUENCY - 1, shear.rigid_frequency / printed.FREQUENCY - 1
    stiffness, stiffer = plain.new.bearing_stiffness / 1e6, shear.new.bearing_stiffness / 1e6
    return (
        Claim(
            "Rigid bearings put f_1 about a third too high; springs must be tuned to the measured frequency.",
            "holds",
            f"{format_share(high)} here. With shear it is {format_share(sheared)}: nearly half of the third is theory.",
        ),
        Claim(
            "The tuned springs stand for the bearings: 1.28e9 N/m each, 7.72e8 N/m after the fall.",
            "holds in part",
            f"They belong to the beam theory: {stiffness:.0f} N/um without shear, {stiffer:.0f} N/um with it, of "
            f"which {format_share(plain.old.factor)} and {format_share(shear.old.factor)} are left at 1550 Hz. Compare "
            "such numbers within one model only.",
        ),
    )


def _spin_claim(shear: shaft_study.ShaftStudy) -> Claim:
    backward, forward = shear.at_speed
    return Claim(
        "f_1 falls with the speed of the spindle and vanishes at the critical speed.",
        "holds in part",
        "Seen from the shaft. From the housing, where hammer, sensor and workpiece are, f_1 of the paper's theory does "
        f"not change at all; with rotary inertia it parts into {backward:.0f} and {forward:.0f} Hz at "
        f"{shaft_study.OPERATING_SPEED_RPM:.0f} rpm. Without it the critical speed is 60 f_1, and no search is needed.",
    )


def _decay_claims(stiffness: shaft_study.StiffnessStudy, lobes: LobeStudy) -> tuple[Claim, Claim]:
    static, modal = (1 - old / new for new, old in (stiffness.static, stiffness.modal))
    before, after = lobes.pocket
    return (
        Claim(
            "With f_1 the tip stiffness falls by 10 %, from K_exp to K_theo.",
            "fails",
            "K_theo is 0.9 K_exp in every digit. On the surrogate the static stiffness falls by "
            f"{format_share(static)}, that of the mode, which an FRF shows, by {format_share(modal)}. Lobewatch takes "
            "K from each new tap test.",
        ),
        Claim(
            "A fall of f_1 by 10 % shifts the stability lobes significantly.",
            "holds",
            f"Sideways: pockets go with f_1 ({before:.0f} to {after:.0f} rpm), and at the speed of that pocket "
            f"{format_share(lobes.pocket_limit_ratio(lobes.by_model))} of the limit is left. Down it is K that counts: "
            f"of the lowest limit {format_share(lobes.share(lobes.by_model))} is left with the model's K, "
            f"{format_share(lobes.share(lobes.by_rule))} by the paper's rule.",
        ),
    )


def _mode_claim(lobes: LobeStudy) -> Claim:
    lowest, worst = lobes.errors_of_one_mode(lobes.one_mode, lobes.six_modes)[::2]
    return Claim(
        "More modes than the first hardly matter for the lobes (its reference [18]).",
        "holds in part",
        f"In the feed alone the lowest limit of one mode is {format_share(lowest)} off that of six of the surrogate; "
        f"on the side of a pocket, which they move, the limit is off by up to {format_share(worst)}.",
    )


@dataclass(frozen=True, eq=False)
class PaperStudy:
    """Results of the comparison with the paper."""

    plain: shaft_study.ShaftStudy
    """Shaft by Euler-Bernoulli theory, as in the paper."""
    shear: shaft_study.ShaftStudy
    """Shaft by Timoshenko theory."""
    meshes: FiniteElementStudy
    """Finite elements."""
    element: NumberGroup
    """Numbers of the spinning element as printed."""
    tap: TapStudy
    """Tap test."""
    stiffness: shaft_study.StiffnessStudy
    """Tip stiffness, new and old."""
    lobes: LobeStudy
    """Stability lobes, new and old."""

    @property
    def sections(self) -> tuple[NumberGroup, ...]:
        """Every number of the paper with ours, in the order of the paper."""
        at_rest, spinning = shaft_study.shaft_sections(self.plain, self.shear)
        of_tip = tap_section(self.tap), shaft_study.stiffness_section(self.stiffness), lobe_section(self.lobes)
        return (self.element, at_rest, mesh_section(self.meshes), spinning, *of_tip)

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Claims of the paper, and whether they hold."""
        shaft = _validation_claim(self.meshes), *_bearing_claims(self.plain, self.shear), _spin_claim(self.shear)
        return (*shaft, *_decay_claims(self.stiffness, self.lobes), _mode_claim(self.lobes))


def study_paper() -> PaperStudy:
    """Run the whole comparison on the packaged surrogate, in about a second of CPU.

    Returns
    -------
    PaperStudy
        All studies, with their numbers and claims.
    """
    plain, shear = shaft_study.study_shaft("euler-bernoulli"), shaft_study.study_shaft("timoshenko")
    tap = study_tap(plain.new.spindle)
    stiffness = shaft_study.study_stiffness(plain.old)
    meshes = study_meshes(plain.rigid, shear.rigid, (plain.rigid_frequency, shear.rigid_frequency))
    lobes = study_lobes(tap.measured, stiffness.modal[1] / stiffness.modal[0], tap.surrogate_modes)
    return PaperStudy(plain, shear, meshes, element_section(plain.rigid), tap, stiffness, lobes)
