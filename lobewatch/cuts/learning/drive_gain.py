"""Gain of the drive: power on its display over the power of the cut, common to all cuts of a machine.

The errors of `PowerEvidence` assume a display that is about right. With some probability it is wrong by any factor, as
with mains power or a load in per cent of another rating. Likelihoods are integrated over this gain, so that readings of
a wrong drive teach little, and stable and chattering cuts tell the gain in time.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Floats
from lobewatch.cuts.learning import cut_likelihood
from lobewatch.cuts.learning.cut_likelihood import (
    CHATTER_POWER_FACTOR,
    CHATTER_POWER_SPREAD,
    CutEvidence,
    PowerEvidence,
    power_distance,
)
from lobewatch.cuts.learning.prior_samples import SpindleSamples

WRONG_GAIN_SHARE, WRONG_GAIN_SPREAD = 0.02, 0.35
"""Share of drives with a wrong gain, and standard deviation of its logarithm; chosen.

With a larger share, one reading of a usual drive would teach little."""
LOG_GAINS = np.linspace(-3, 3, 25) * WRONG_GAIN_SPREAD
"""Logarithms of the gains of the integration; one of them is 0."""
MIN_DOUBTED_GAIN = 1.15
"""Smallest mean gain, or its inverse, that is doubted; chosen, the spread of usual drives."""


def _log_prior() -> Floats:
    """Return the logarithm of the probability of each gain, shape (g,)."""
    wrong = np.exp(-((LOG_GAINS / WRONG_GAIN_SPREAD) ** 2) / 2)
    share = WRONG_GAIN_SHARE * wrong / np.sum(wrong)
    return np.asarray(np.log(share + (1 - WRONG_GAIN_SHARE) * (LOG_GAINS == 0)))


def power_log_likelihood(cut: CutEvidence, samples: SpindleSamples, before: Sequence[CutEvidence]) -> Floats:
    """Return the log likelihood of the power of a cut after those before it, shape (r,), at most 0; 0 without one."""
    if cut.power is None:
        return np.zeros(len(samples))
    earlier = sum((_by_gain(other, samples, before[:k]) for k, other in enumerate(before)), start=_log_prior())
    joint = scipy.special.logsumexp(earlier + _by_gain(cut, samples, before), axis=-1)
    return np.asarray(joint - scipy.special.logsumexp(earlier, axis=-1))


def wrong_stable_log_ratio(cut: CutEvidence, samples: SpindleSamples, others: Sequence[CutEvidence]) -> Floats:
    """Return the log likelihood of the power of a stable cut if it chattered over that if it was stable, shape (r,).

    Chatter often lowers the power, so the power of other cuts tells a wrong "stable". A chattering cut may have full
    power: 0 for other verdicts, and without a power.
    """
    if cut.power is None or cut.verdict != "stable":
        return np.zeros(len(samples))
    chattering, stable = (
        power_log_likelihood(each, samples, others) - np.log(power_distance(each, np.ones(1), others)[1]) / 2
        for each in (replace(cut, power=assume_chatter(cut.power)), cut)
    )
    return np.asarray(chattering - stable)


def assume_chatter(power: PowerEvidence) -> PowerEvidence:
    """Return the evidence of the power of a stable cut if it chattered."""
    error = math.hypot(power.own_error, CHATTER_POWER_SPREAD)
    return replace(power, force=power.force / CHATTER_POWER_FACTOR, own_error=error)


def _by_gain(cut: CutEvidence, samples: SpindleSamples, before: Sequence[CutEvidence]) -> Floats:
    """Return the log likelihood of the power of a cut for each sample and gain, shape (r, g)."""
    if cut.power is None:
        return np.zeros((1, LOG_GAINS.size))
    shown = samples.force_factors(cut.material)[:, np.newaxis] * np.exp(LOG_GAINS)
    return cut_likelihood.power_log_likelihood(cut, shown, before)


class DisplayedPower(NamedTuple):
    """Displayed power compared with the samples, shape (r,) each."""

    gain: Floats
    """Mean displayed power over the power of the cuts."""
    log_likelihood: Floats
    """Log likelihood of all powers."""


def compare_displayed_power(cuts: Sequence[CutEvidence], samples: SpindleSamples) -> DisplayedPower | None:
    """Compare the displayed power of cuts with that of each sample; None without a power."""
    forces = [(cut.power.force, samples.force_factors(cut.material)) for cut in cuts if cut.power is not None]
    if not forces:
        return None
    gain = np.exp(np.mean([np.log(shown / force) for shown, force in forces], axis=0))
    likelihoods = [power_log_likelihood(cut, samples, cuts[:k]) for k, cut in enumerate(cuts)]
    return DisplayedPower(np.asarray(gain), np.asarray(np.sum(likelihoods, axis=0)))
