"""Stability lobes of Fig. 10, new and old, by the paper's rule for K and by the model's."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobes import Cut, StabilityLobes, age_mode, average_angle_lobes, match_pockets, zero_order_lobes
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup
from modal import Mode

STUDY_CUT = Cut(teeth=2, immersion=1.0, direction="up", tangential=600e6, radial=180e6)
"""Slot with two teeth. The paper gives no cut: Kt scales all depths alike, the teeth all speeds."""
LOBE_SPEEDS_RPM = np.arange(6000.0, 30001.0, 2.0)
"""Spindle speeds (rpm)."""
POCKET_DEPTH_RATIO = 20.0
"""Largest pocket depth over the lowest limit."""


class LobeStudy(NamedTuple):
    """Lobes of one mode, new and old, and of more modes."""

    new: StabilityLobes
    """Lobes of the measured mode."""
    by_rule: StabilityLobes
    """Lobes of the old mode: f1 and K 10 % lower, as in the paper."""
    by_model: StabilityLobes
    """Lobes of the old mode with K of the recalibrated model."""
    one_mode: StabilityLobes
    """Lobes of mode 1 of the surrogate."""
    six_modes: StabilityLobes
    """Lobes of six modes of the surrogate."""
    by_zero_order: tuple[StabilityLobes, StabilityLobes]
    """Lobes of one and of all modes, equal in x and y, by the zero-order approximation."""
    masses: tuple[float, ...]
    """Modal mass of mode 1 (kg): measured, old by the rule, old by the model."""

    def share(self, lobes: StabilityLobes) -> float:
        """Return the lowest limit over that of the new spindle."""
        return lobes.minimum.depth / self.new.minimum.depth

    @property
    def pocket(self) -> tuple[float, float]:
        """Speed of the deepest pocket below the end of the chart, new and old (rpm)."""
        shifts = match_pockets(self.new, self.by_rule, POCKET_DEPTH_RATIO * self.new.minimum.depth)
        deepest = max(shifts, key=lambda shift: shift.before.depth)
        return deepest.before.speed_rpm, deepest.after.speed_rpm

    def pocket_limit_ratio(self, lobes: StabilityLobes) -> float:
        """Return the limit at the speed of the new spindle's pocket over the new one."""
        speed = self.pocket[0]
        return float(lobes.depth_at(speed) / self.new.depth_at(speed))

    @staticmethod
    def errors_of_one_mode(first: StabilityLobes, several: StabilityLobes) -> tuple[float, float, float]:
        """Return the relative error of one mode: lowest limit, and median and largest over all speeds."""
        error = np.abs(first.depth / several.depth - 1)
        return first.minimum.depth / several.minimum.depth - 1, float(np.median(error)), float(np.max(error))


def study_lobes(measured: Mode, stiffness_ratio: float, modes: Sequence[Mode]) -> LobeStudy:
    """Compare lobes of the paper's mode, of the model's K old over new, and of the modes of the surrogate."""
    ratio = printed.OLD_FREQUENCY / printed.FREQUENCY
    aged = age_mode(measured, 0.9, "paper"), age_mode(measured, ratio, "model", stiffness_ratio)
    tips = [measured], [aged[0]], [aged[1]], modes[:1], modes
    new, by_rule, by_model, one_mode, six_modes = (
        average_angle_lobes(tip, None, STUDY_CUT, LOBE_SPEEDS_RPM) for tip in tips
    )
    narrow, full = (zero_order_lobes(tip, tip, STUDY_CUT, LOBE_SPEEDS_RPM) for tip in tips[-2:])
    masses = tuple(float(mode.stiffness / (2 * np.pi * mode.frequency) ** 2) for mode in (measured, *aged))
    return LobeStudy(new, by_rule, by_model, one_mode, six_modes, (narrow, full), masses)


def lobe_section(study: LobeStudy) -> NumberGroup:
    """Return the numbers of the lobes."""
    before, after = study.pocket
    deepest = f"deepest pocket below {LOBE_SPEEDS_RPM[-1]:.0f} rpm, two flutes"
    moved = f"x {after / before:.3f}: the pocket shifts with f1, independent of stiffness K"
    text = "old limit over new limit at the speed of the new pocket"
    rule, model = study.pocket_limit_ratio(study.by_rule), study.pocket_limit_ratio(study.by_model)
    numbers = (
        *_limit_numbers(study),
        Comparison("pocket speed, new", "Fig. 10", None, before, "rpm", 5, deepest),
        Comparison("pocket speed, old", "Fig. 10", None, after, "rpm", 5, moved),
        Comparison("remaining limit, paper's rule", "Fig. 10", None, rule, "-", 3, text),
        Comparison("remaining limit, model's K", "", None, model, "-", 3, text),
        *_further_numbers(study),
    )
    return NumberGroup("Stability lobes, new and old: Fig. 10", ("fig-10",), numbers)


def _limit_numbers(study: LobeStudy) -> list[Comparison]:
    loop = STUDY_CUT.specific_force * STUDY_CUT.teeth_in_cut * STUDY_CUT.orientation_factors[0]
    per_stiffness = 2 * printed.DAMPING_RATIO * (1 + printed.DAMPING_RATIO)
    new, old = study.new.minimum.depth * loop, study.by_rule.minimum.depth * loop
    form = "paper: 2 K zeta (1 + zeta) of the printed K and zeta. Ours: lowest point of the chart."
    by_rule, by_model = study.share(study.by_rule), study.share(study.by_model)
    rule = "K x 0.9, independent of the cut (the paper gives neither coefficients nor teeth)"
    tip = "lowest limit is proportional to K, which worn bearings hardly change at the tip"
    masses = ("new", "K/w^2 of the paper's mode"), ("old, rule", "K x 0.9 at f x 0.9 means mass / 0.9")
    named = (*masses, ("old, model", "more of the shaft moves with the tip"))
    return [
        Comparison("b_lim Ks mu Nt*, new", "Fig. 10", per_stiffness * printed.STIFFNESS, new, "N/m", 6, form),
        Comparison("b_lim Ks mu Nt*, old", "Fig. 10", per_stiffness * printed.OLD_STIFFNESS, old, "N/m", 6, form),
        Comparison("lowest limit, old over new", "Fig. 10", 0.9, by_rule, "-", 4, rule),
        Comparison("lowest limit ratio, model's K", "", 0.9, by_model, "-", 4, tip),
        *(
            Comparison(f"modal mass, {name}", "", None, mass, "kg", 4, reason)
            for (name, reason), mass in zip(named, study.masses, strict=True)
        ),
    ]


def _further_numbers(study: LobeStudy) -> list[Comparison]:
    rows = []
    for name, first, several in (("feed only", study.one_mode, study.six_modes), ("x and y", *study.by_zero_order)):
        lowest, median, worst = (100 * error for error in study.errors_of_one_mode(first, several))
        beginning = f"one mode, {name}"
        method = {"zero order": "ZOA"}.get(several.method, several.method)
        claim = f"error of the lowest limit, 1 mode instead of 6 ({method}): a claim of reference [18] of the paper"
        side = "error on the side of a pocket, which other modes shift"
        rows += [
            Comparison(f"{beginning}: lowest", "", None, lowest, "%", 2, claim),
            Comparison(f"{beginning}: median", "", None, median, "%", 2, "absolute error over all speeds"),
            Comparison(f"{beginning}: worst", "", None, worst, "%", 2, side),
        ]
    return rows
