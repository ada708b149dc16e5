"""What becomes of a mode when its frequency falls: the one home of the rules for K."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from modal import Mode

Rule = Literal["measured", "model", "paper"]


def aged_mode(baseline: Mode, ratio: float, rule: Rule, stiffness_ratio: float | None = None) -> Mode:
    """The mode at `ratio` times its frequency, with the damping of the baseline and the stiffness that a rule gives it.

    "measured": K times `stiffness_ratio`, that of a new tap test to the baseline's (needed). "model": K times
    `stiffness_ratio`, the ratio of modal stiffness of a recalibrated model; without one K stays, and `method` says so.
    "paper": K times `ratio`, as Gaber & Hashemi (2015) assume (K x 0.9 for f x 0.9); no stiffness_ratio. The covariance
    is scaled along. Raises ValueError for ratios <= 0 and a stiffness_ratio that does not go with the rule.

    >>> new = Mode(frequency=1000.0, damping_ratio=0.03, stiffness=2e7)
    >>> old = aged_mode(new, 0.9, "paper")
    >>> round(old.frequency), round(old.stiffness / 1e6, 1)  # Hz, N/um
    (900, 18.0)
    >>> old = aged_mode(new, 0.9, "measured", stiffness_ratio=0.85)
    >>> round(old.frequency), round(old.stiffness / 1e6, 1)
    (900, 17.0)
    """
    if rule not in get_args(Rule):
        raise ValueError(f"rule={rule!r} is none of {', '.join(get_args(Rule))}; choose what K does when f_n falls")
    for name, value in (("ratio", ratio), ("stiffness_ratio", 1.0 if stiffness_ratio is None else stiffness_ratio)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name}={value} is not a finite number > 0; give new over old")
    if rule == "measured" and stiffness_ratio is None:
        raise ValueError('rule="measured" needs stiffness_ratio, K of the new tap test over K of the baseline')
    if rule == "paper" and stiffness_ratio is not None:
        raise ValueError(f'rule="paper" sets K itself; leave stiffness_ratio={stiffness_ratio} out')
    softer = ratio if rule == "paper" else 1.0 if stiffness_ratio is None else stiffness_ratio
    rule_text = "K constant, no model" if rule == "model" and stiffness_ratio is None else f"K by rule {rule}"
    return baseline.scaled(ratio, softer, f"aged, {rule_text}")
