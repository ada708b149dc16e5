"""What the paper claims, and whether it holds on the surrogate."""

from __future__ import annotations

from lobewatch.paper import printed
from lobewatch.paper.comparison import Claim, share_text
from lobewatch.paper.fe_study import FiniteElementStudy
from lobewatch.paper.lobe_study import LobeStudy
from lobewatch.paper.shaft_study import OPERATING_SPEED, ShaftStudy
from lobewatch.paper.stiffness_study import StiffnessStudy


def claims(
    plain: ShaftStudy, shear: ShaftStudy, meshes: FiniteElementStudy, stiffness: StiffnessStudy, lobes: LobeStudy
) -> tuple[Claim, ...]:
    """In the order of the paper; plain is Euler-Bernoulli, shear Timoshenko theory."""
    return (_validation(meshes), *_bearings(plain, shear), _spin(shear), *_decay(stiffness, lobes), _modes(lobes))


def _validation(meshes: FiniteElementStudy) -> Claim:
    softer = meshes.exact["timoshenko"] / meshes.exact["euler-bernoulli"] - 1
    return Claim(
        "Finite elements with shear validate the model without it: 2367 against 2303 Hz, less than 3 % apart.",
        "fails",
        f"Shear takes {share_text(-softer)} off f_1 of this shaft, and {printed.FEM_ELEMENTS} elements are exact to "
        f"{share_text(meshes.error('linear'))}. With shear f_1 lies below that without it, even clamped in all "
        f"bearings ({meshes.clamped:.0f} Hz): a model with shear that lies above is another shaft, and how little "
        "above says nothing.",
    )


def _bearings(plain: ShaftStudy, shear: ShaftStudy) -> tuple[Claim, Claim]:
    high, sheared = plain.rigid_frequency / printed.FREQUENCY - 1, shear.rigid_frequency / printed.FREQUENCY - 1
    stiffness, stiffer = plain.new.bearing_stiffness / 1e6, shear.new.bearing_stiffness / 1e6
    return (
        Claim(
            "Rigid bearings put f_1 about a third too high; springs must be tuned to the measured frequency.",
            "holds",
            f"{share_text(high)} here. With shear it is {share_text(sheared)}: nearly half of the third is theory.",
        ),
        Claim(
            "The tuned springs stand for the bearings: 1.28e9 N/m each, 7.72e8 N/m after the fall.",
            "holds in part",
            f"They belong to the beam theory: {stiffness:.0f} N/um without shear, {stiffer:.0f} N/um with it, of "
            f"which {share_text(plain.old.factor)} and {share_text(shear.old.factor)} are left at 1550 Hz. Compare "
            "such numbers within one model only.",
        ),
    )


def _spin(shear: ShaftStudy) -> Claim:
    backward, forward = shear.at_speed
    return Claim(
        "f_1 falls with the speed of the spindle and vanishes at the critical speed.",
        "holds in part",
        "Seen from the shaft. From the housing, where hammer, sensor and workpiece are, f_1 of the paper's theory does "
        f"not change at all; with rotary inertia it parts into {backward:.0f} and {forward:.0f} Hz at "
        f"{OPERATING_SPEED:.0f} rpm. Without it the critical speed is 60 f_1, and no search is needed.",
    )


def _decay(stiffness: StiffnessStudy, lobes: LobeStudy) -> tuple[Claim, Claim]:
    static, modal = (1 - old / new for new, old in (stiffness.static, stiffness.modal))
    before, after = lobes.pocket
    return (
        Claim(
            "With f_1 the tip stiffness falls by 10 %, from K_exp to K_theo.",
            "fails",
            "K_theo is 0.9 K_exp in every digit. On the surrogate the static stiffness falls by "
            f"{share_text(static)}, that of the mode, which an FRF shows, by {share_text(modal)}. Lobewatch takes K "
            "from each new tap test.",
        ),
        Claim(
            "A fall of f_1 by 10 % shifts the stability lobes significantly.",
            "holds",
            f"Sideways: pockets go with f_1 ({before:.0f} to {after:.0f} rpm), and at the speed of that pocket "
            f"{share_text(lobes.left_in_pocket(lobes.by_model))} of the limit is left. Down it is K that counts: of "
            f"the lowest limit {share_text(lobes.share(lobes.by_model))} is left with the model's K, "
            f"{share_text(lobes.share(lobes.by_rule))} by the paper's rule.",
        ),
    )


def _modes(lobes: LobeStudy) -> Claim:
    lowest, worst = lobes.errors_of_one_mode(lobes.one_mode, lobes.six_modes)[::2]
    return Claim(
        "More modes than the first hardly matter for the lobes (its reference [18]).",
        "holds in part",
        f"In the feed alone the lowest limit of one mode is {share_text(lowest)} off that of six of the surrogate; on "
        f"the side of a pocket, which they move, the limit is off by up to {share_text(worst)}.",
    )
