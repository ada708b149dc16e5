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
        "Finite elements with shear validate the model without shear: 2367 compared with 2303 Hz, less than 3 % apart.",
        "fails",
        f"Shear lowers f1 of this shaft by {format_share(-softer)}, and {printed.FEM_ELEMENTS} elements are exact to "
        f"{format_share(meshes.error('linear'))}. f1 with shear is always below f1 without shear, even if clamped in "
        f"all bearings ({meshes.clamped:.0f} Hz). If f1 with shear is higher, the model describes another shaft.",
    )


def _bearing_claims(plain: shaft_study.ShaftStudy, shear: shaft_study.ShaftStudy) -> tuple[Claim, Claim]:
    high, sheared = plain.rigid_frequency / printed.FREQUENCY - 1, shear.rigid_frequency / printed.FREQUENCY - 1
    stiffness, stiffer = plain.new.bearing_stiffness / 1e6, shear.new.bearing_stiffness / 1e6
    return (
        Claim(
            "Rigid bearings make f1 about a third too high. Springs must be tuned to the measured frequency.",
            "holds",
            f"{format_share(high)} on the surrogate shaft, but {format_share(sheared)} with shear: the "
            "beam theory explains nearly half of the excess.",
        ),
        Claim(
            "The tuned springs represent the bearings: 1.28e9 N/m each, 7.72e8 N/m after the frequency drop.",
            "holds in part",
            f"The springs depend on the beam theory: {stiffness:.0f} N/um without shear, {stiffer:.0f} N/um with "
            f"shear. At 1550 Hz {format_share(plain.old.factor)} and {format_share(shear.old.factor)} of the "
            "stiffness remain. Compare bearing stiffnesses within one model only.",
        ),
    )


def _spin_claim(shear: shaft_study.ShaftStudy) -> Claim:
    backward, forward = shear.at_speed
    return Claim(
        "f1 drops with spindle speed and reaches zero at the critical speed.",
        "holds in part",
        "f1 drops in the rotating frame only. In the fixed frame of hammer, sensor and workpiece, f1 of the paper's "
        f"theory does not change. With rotary inertia f1 splits into {backward:.0f} and {forward:.0f} Hz at "
        f"{shaft_study.OPERATING_SPEED_RPM:.0f} rpm. Without rotary inertia the critical speed is simply 60 f1.",
    )


def _decay_claims(stiffness: shaft_study.StiffnessStudy, lobes: LobeStudy) -> tuple[Claim, Claim]:
    static, modal = (1 - old / new for new, old in (stiffness.static, stiffness.modal))
    before, after = lobes.pocket
    return (
        Claim(
            "The tip stiffness drops by 10 % with f1, from K_exp to K_theo.",
            "fails",
            "K_theo is 0.9 K_exp in every digit. On the surrogate the static stiffness drops by "
            f"{format_share(static)}, the modal stiffness seen in an FRF by {format_share(modal)}. lobewatch measures "
            "stiffness K in each tap test.",
        ),
        Claim(
            "A drop of f1 by 10 % shifts the stability lobes significantly.",
            "holds",
            f"Pockets shift with f1 ({before:.0f} to {after:.0f} rpm). At the speed of the new pocket "
            f"{format_share(lobes.pocket_limit_ratio(lobes.by_model))} of the limit remains. The lowest limit depends "
            f"on stiffness K: {format_share(lobes.share(lobes.by_model))} remains with the model's K, "
            f"{format_share(lobes.share(lobes.by_rule))} by the paper's rule.",
        ),
    )


def _mode_claim(lobes: LobeStudy) -> Claim:
    lowest, worst = lobes.errors_of_one_mode(lobes.one_mode, lobes.six_modes)[::2]
    return Claim(
        "Modes above the first hardly affect the lobes (reference [18] of the paper).",
        "holds in part",
        f"With one mode instead of six, along the feed only, the lowest limit is off by {format_share(lowest)}. "
        f"On the side of a pocket, shifted by the other modes, the limit is off by up to {format_share(worst)}.",
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
