"""Milling with straight teeth step by step as it happens: no deviations, no tables, no batches."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from milling_steps import Case, Floats


class PlainCut(NamedTuple):
    """Simulated motion step by step, shape (periods, steps) each."""

    motion: Floats
    """Displacement along the feed in feeds per tooth."""
    chips: Floats
    """Sum of the chips of all teeth in feeds per tooth."""
    touching: Floats
    """Number of teeth that cut."""


def plain_cut(case: Case, steps: int, periods: int) -> PlainCut:
    """Simulate a cut that starts at rest in a smooth part.

    Machine axes throughout; every pass leaves its mark on the part. Semi-implicit Euler.
    """
    f, zeta, k = np.array(case.x + case.y).T
    w, step = 2 * math.pi * f, case.tooth_period / steps
    to_tip = np.repeat(np.eye(2), [len(case.x), len(case.y)], axis=1)
    feed = np.array([math.cos(case.feed_angle), math.sin(case.feed_angle)])
    outward, force, part = _round(case, steps, feed)
    q, v, path = np.zeros(f.size), np.zeros(f.size), np.empty((periods * steps, 2))
    chips, touching = np.empty(len(path)), np.empty(len(path))
    for i in range(len(path)):
        at = (i + steps * np.arange(case.teeth)) % len(part)
        path[i] = to_tip @ q
        reach = outward[at] @ (path[i] + feed * (i / steps))
        chip = np.maximum(reach - part[at], 0)
        part[at] = np.maximum(part[at], reach)
        inside = np.any(force[at], axis=1)
        chips[i], touching[i] = np.sum(chip[inside]), np.sum(chip[inside] > 0)
        v += step * (w**2 / k * (to_tip.T @ (chip @ force[at])) - 2 * zeta * w * v - w**2 * q)
        q += step * v
    return PlainCut(*(record.reshape(periods, steps) for record in (path @ feed, chips, touching)))


def _round(case: Case, steps: int, feed: Floats) -> tuple[Floats, Floats, Floats]:
    """Outward normal, force per chip and surface of the part at each angle of a round, in machine axes."""
    number = np.arange(steps * case.teeth)
    angle = 2 * math.pi * (number + 0.5) / number.size
    normal = np.array([-feed[1], feed[0]])
    outward = np.outer(np.sin(angle), feed) + np.outer(np.cos(angle), normal)
    ahead = np.outer(np.cos(angle), feed) - np.outer(np.sin(angle), normal)
    force = -case.depth * (case.tangential * ahead + case.radial * outward)
    inside = (angle >= case.arc[0]) & (angle <= case.arc[1])
    part = np.where(inside, np.sin(angle) * (number % steps / steps - 1), 0.0)
    return outward, np.where(inside[:, np.newaxis], force, 0.0), part
