"""Posterior of the rotating spindle: samples weighted by the test cuts, and cuts whose label contradicts the others."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from acquisition import Remark
from lobes import MillingRows
from lobewatch.arrays import Floats, Indices
from lobewatch.cuts.learning import cut_likelihood, drive_gain
from lobewatch.cuts.learning.cut_likelihood import CutEvidence, CutPrediction, predict_cut
from lobewatch.cuts.learning.power_readings import make_material_remark
from lobewatch.cuts.learning.prior_samples import SpindleSamples, sample_prior
from lobewatch.cuts.learning.process_damping import NO_PROCESS_DAMPING, ProcessDamping
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.verdicts.speed_drop import DEFAULT_DROP, SpeedDrop
from lobewatch.verdicts.uncertainty import Uncertainty

N_PRIOR_SAMPLES = 2000
"""Number of samples."""
N_REFRESHED_SAMPLES = 500
"""Number of samples after resampling."""
MIN_EFFECTIVE_SAMPLES = 120
"""Effective sample size below which samples are redrawn."""
N_MARKOV_MOVES, MARKOV_STEP_SHARE = 4, 0.5
"""Number of Markov moves of each sample, and their size as a share of the spread."""
ADDED_VARIANCE = 1e-4
"""Variance added to that of the samples before they are moved, as few equal samples have none."""
NEGLIGIBLE_WEIGHT = 1e-6
"""Share of the largest weight below which a sample is ignored."""
MIN_CHATTER_FREQUENCIES, OPEN_FREQUENCY_INTERVAL = 2, (0.90, 1.05)
"""Number of chatter frequencies that determine frequencies at speed, and interval with fewer (factors); chosen."""
INTERVAL_LEVEL = 0.95
"""Share of the weight within an interval."""


class Interval(NamedTuple):
    """Interval of a learned factor, relative to the value not rotating or to the table for coefficients."""

    mean: float
    """Weighted mean."""
    low: float
    """2.5 % quantile."""
    high: float
    """97.5 % quantile."""
    std: float
    """Weighted standard deviation."""

    def no_narrower(self, low: float, high: float) -> "Interval":
        """Return an interval that includes both values."""
        return self._replace(low=min(self.low, low), high=max(self.high, high))


class Posterior(NamedTuple):
    """Weighted samples of the rotating spindle."""

    samples: SpindleSamples
    """Samples of the spindle at speed."""
    log_weight: Floats
    """Logarithm of each weight, up to a constant, shape (r,)."""
    cuts: tuple[CutEvidence, ...] = ()
    """Cuts that the weights are based on."""
    n_refreshed: int = 0
    """Number of times that the samples were redrawn."""
    seed: int = 0
    """Seed of all samples."""

    @property
    def weights(self) -> Floats:
        """Weight of each sample, sum 1, shape (r,)."""
        weights = np.exp(self.log_weight - np.max(self.log_weight))
        return np.asarray(weights / np.sum(weights))

    @property
    def effective_size(self) -> float:
        """Effective sample size."""
        return float(1 / np.sum(self.weights**2))

    @property
    def intervals(self) -> dict[str, Interval]:
        """Intervals by name; those of natural frequencies stay open until chatter was recorded twice."""
        intervals = {name: _weighted_interval(values, self.weights) for name, values in self.samples.ratios().items()}
        if self.n_frequencies < MIN_CHATTER_FREQUENCIES:
            names = [name for name in intervals if name.startswith("frequency")]
            intervals |= {name: intervals[name].no_narrower(*OPEN_FREQUENCY_INTERVAL) for name in names}
        return intervals

    @property
    def drive_gain(self) -> Interval | None:
        """Interval of the displayed power over that of the cuts by their verdicts only; None without a power."""
        shown = drive_gain.compare_displayed_power(self.cuts, self.samples)
        if shown is None:
            return None
        by_verdicts = self._replace(log_weight=self.log_weight - shown.log_likelihood)
        return _weighted_interval(shown.gain, by_verdicts.weights)

    @property
    def n_frequencies(self) -> int:
        """Number of cuts with a chatter frequency; without any, natural frequencies cannot be learned."""
        return sum(cut.has_frequency for cut in self.cuts)

    @property
    def is_frequency_unusual(self) -> bool:
        """True if a natural frequency is probably further from that not rotating than in 95 % of spindles."""
        leading = [values for name, values in self.samples.ratios().items() if name in ("frequency_x", "frequency_y")]
        low, high = self.samples.usual_frequency_interval
        beside = [(low < values) & (values < high) for values in leading]
        usual = float(np.sum(self.weights * np.all(beside, axis=0)))
        return self.n_frequencies >= MIN_CHATTER_FREQUENCIES and usual < 1 / 2

    def learn_from(self, cut: CutEvidence) -> "Posterior":
        """Update with one more cut."""
        return self.predict(cut).update()

    def predict(self, cut: CutEvidence) -> "NewEvidence":
        """Predict a cut on the samples that are not ruled out."""
        likely = np.flatnonzero(self.log_weight > np.max(self.log_weight) + np.log(NEGLIGIBLE_WEIGHT))
        samples = self.samples[likely].with_materials(cut.material + 1, self.seed)
        before = self._replace(samples=samples, log_weight=self.log_weight[likely])
        return NewEvidence(before, cut, predict_cut(cut, samples))

    def draw(self, count: int) -> SpindleSamples:
        """Draw samples of equal weight."""
        random = np.random.default_rng((self.seed, 4, len(self.cuts)))
        return self.samples[_resample_indices(self.weights, count, random)]

    def resample(self, count: int) -> "Posterior":
        """Resample to a number of samples of equal weight."""
        return self._replace(samples=self.draw(count), log_weight=np.zeros(count))


class NewEvidence(NamedTuple):
    """New cut before the posterior is updated."""

    prior: Posterior
    """Posterior without the cut: samples that have weight, with coefficients of its material."""
    cut: CutEvidence
    """New cut."""
    prediction: CutPrediction
    """Predicted behavior of each sample in the cut."""

    def update(self) -> Posterior:
        """Update the posterior with the cut."""
        prior = self.prior
        likelihood = _cut_log_likelihood(self.cut, prior.samples, self.prediction, prior.cuts)
        posterior = prior._replace(log_weight=prior.log_weight + likelihood, cuts=(*prior.cuts, self.cut))
        return _refresh(posterior) if posterior.effective_size < MIN_EFFECTIVE_SAMPLES else posterior

    def without_power(self) -> "NewEvidence":
        """Return the cut without its power."""
        return self._replace(cut=replace(self.cut, power=None))


def build_prior(
    rest: MillingRows,
    uncertainty: Uncertainty,
    count: int = N_PRIOR_SAMPLES,
    seed: int = 0,
    drop: SpeedDrop = DEFAULT_DROP,
    damping: ProcessDamping = NO_PROCESS_DAMPING,
) -> Posterior:
    """Build the posterior before the first cut.

    rest: the spindle without rotation in the median estimate (a row); drop: of its frequencies at speed; damping: of
    the process.
    """
    return Posterior(sample_prior(rest, uncertainty, count, seed, drop, damping), np.zeros(count), seed=seed)


def _cut_log_likelihood(
    cut: CutEvidence, samples: SpindleSamples, prediction: CutPrediction, before: Sequence[CutEvidence]
) -> Floats:
    """Return the log likelihood of one cut after those before it; an old cut counts less."""
    repeats = [other for other in before if cut.is_repeat_of(other)]
    verdict = cut.weight * cut_likelihood.log_likelihood(cut, prediction, repeats)
    power = drive_gain.power_log_likelihood(cut, samples, before)
    if cut.power is None or cut.verdict != "stable":
        return verdict + power
    wrong = cut_likelihood.mislabel_probability(cut, prediction, repeats)
    ratio = np.exp(drive_gain.wrong_stable_log_ratio(cut, samples, before))
    return np.asarray(verdict + power + np.log1p(wrong * (ratio - 1)))


def _refresh(posterior: Posterior) -> Posterior:
    """Resample to equal weights, and move each sample by Metropolis-Hastings steps."""
    weights, samples, cuts = posterior.weights, posterior.samples, posterior.cuts
    random = np.random.default_rng((posterior.seed, 3, len(cuts)))
    spread = np.cov(samples.normal.T, aweights=weights) + ADDED_VARIANCE * np.eye(samples.normal.shape[1])
    root = np.linalg.cholesky(spread) * MARKOV_STEP_SHARE
    chosen, copies = np.unique(_resample_indices(weights, N_REFRESHED_SAMPLES, random), return_inverse=True)
    value = _joint_log_density(samples[chosen], cuts, np.full(len(chosen), -np.inf))[copies]
    samples = samples[chosen[copies]]
    for _ in range(N_MARKOV_MOVES):
        moved = replace(samples, normal=samples.normal + random.standard_normal(samples.normal.shape) @ root.T)
        least = value + np.log(random.uniform(size=len(samples)))
        moved_value = _joint_log_density(moved, cuts, least)
        taken = moved_value > least
        normal = np.where(taken[:, np.newaxis], moved.normal, samples.normal)
        samples, value = replace(samples, normal=normal), np.where(taken, moved_value, value)
    return posterior._replace(samples=samples, log_weight=np.zeros(len(samples)), n_refreshed=posterior.n_refreshed + 1)


def _joint_log_density(samples: SpindleSamples, cuts: Sequence[CutEvidence], least: Floats) -> Floats:
    """Return the log of prior times likelihood of all cuts; -inf where that is not above the least (r,).

    A sample that cannot come to more any more is not evaluated for further cuts.
    """
    value: Floats = -np.sum(samples.normal**2, axis=1) / 2
    hope = [cut.weight * cut_likelihood.max_log_likelihood(cut) for cut in cuts]
    for k, cut in enumerate(cuts):
        value[value + sum(hope[k:]) <= least] = -np.inf
        asked = np.flatnonzero(np.isfinite(value))
        if asked.size:
            left = samples[asked]
            value[asked] += _cut_log_likelihood(cut, left, predict_cut(cut, left), cuts[:k])
    return value


def _resample_indices(weights: Floats, count: int, random: np.random.Generator) -> Indices:
    """Draw indices systematically by weight, each in proportion to its weight within one."""
    at = (np.arange(count) + random.uniform()) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), at), weights.size - 1)


def _weighted_interval(values: Floats, weights: Floats) -> Interval:
    order = np.argsort(values)
    share = np.cumsum(weights[order]) - weights[order] / 2
    low, high = np.interp([(1 - INTERVAL_LEVEL) / 2, (1 + INTERVAL_LEVEL) / 2], share, values[order])
    mean = float(np.sum(weights * values))
    return Interval(mean, float(low), float(high), float(np.sqrt(np.sum(weights * (values - mean) ** 2))))


MAX_WRONG_PROBABILITY = 0.5
"""Chance of a wrong label, given all cuts, from which a label is rejected."""
N_CHECK_SAMPLES = 300
"""Number of samples used to check a cut."""
MAX_FREQUENCY_DEVIATION = 4.0
"""Largest credible deviation (standard deviations) of a chatter frequency or of Kt by power; chosen."""
MIN_EXPLAINED_WEIGHT = 0.005
"""Share of the weight by the other cuts that counts as zero; chosen."""


class Contradiction(StrEnum):
    """Contradiction between a cut and the model."""

    FREQUENCY = "frequency"
    """Chatter at a frequency without a mode."""
    CHATTERS = "chatters"
    """Chatter where most samples that explain the other cuts are stable."""
    STABLE = "stable"
    """Stable where most samples that explain the other cuts chatter."""
    POWER = "power"
    """Power with another Kt than that of the cuts before it."""
    MATERIAL = "material"
    """Power with a Kt that is off from that of the material by a factor of two."""


POWER_CONTRADICTIONS = (Contradiction.POWER, Contradiction.MATERIAL)
"""Contradictions that leave the verdict of a cut valid."""


class InconsistentCut(NamedTuple):
    """Cut with a rejected label or power, or with a frequency of no mode."""

    cut: CutEvidence
    """Rejected cut."""
    contradiction: Contradiction
    """Contradiction for which it is rejected."""
    wrong_probability: float = 0.0
    """Chance of a wrong label."""


def wrong_label_probability(evidence: NewEvidence) -> float:
    """Return the probability that the verdict of a cut is wrong on spindles that explain all cuts."""
    cut, before = evidence.cut, evidence.prior
    wrong = cut_likelihood.mislabel_probability(cut, evidence.prediction, _repeats_of(cut, before))
    others = [other for other in before.cuts if other is not cut]
    ratio = np.exp(drive_gain.wrong_stable_log_ratio(cut, before.samples, others))
    return float(np.sum(before.weights * wrong * ratio / (1 - wrong + wrong * ratio)))


def find_contradiction(evidence: NewEvidence) -> InconsistentCut | None:
    """Find what contradicts a cut on spindles that explain all cuts, or None."""
    cut, prediction, weights = evidence.cut, evidence.prediction, evidence.prior.weights
    wrong = wrong_label_probability(evidence)
    if np.isfinite(cut.frequency) and cut.has_chatter:
        reach = MAX_FREQUENCY_DEVIATION * cut_likelihood.CHATTER_FREQUENCY_SPREAD * cut.frequency
        near = np.any(prediction.frequency_distances(cut) < reach, axis=0)
        likelihood = cut_likelihood.log_likelihood(cut, prediction, _repeats_of(cut, evidence.prior))
        others = weights * np.exp(-cut.weight * likelihood)
        if np.sum(others * near) < MIN_EXPLAINED_WEIGHT * np.sum(others):
            return InconsistentCut(cut, Contradiction.FREQUENCY, wrong)
    if wrong <= MAX_WRONG_PROBABILITY:
        return None
    return InconsistentCut(cut, Contradiction.CHATTERS if cut.has_chatter else Contradiction.STABLE, wrong)


def is_power_inconsistent(evidence: NewEvidence) -> bool:
    """Return whether the power of a cut implies another Kt than all earlier cuts."""
    cut, before = evidence.cut, evidence.prior
    if cut.power is None:
        return False
    distance, variance = cut_likelihood.power_distance(cut, before.samples.force_factors(cut.material), before.cuts)
    mean = np.sum(before.weights * distance)
    spread = np.sqrt(np.sum(before.weights * (distance - mean) ** 2) + variance)
    return bool(abs(mean) > MAX_FREQUENCY_DEVIATION * spread)


def find_inconsistent_cuts(posterior: Posterior) -> tuple[InconsistentCut, ...]:
    """Find the cuts to reject, of those that were learned from."""
    few = posterior.resample(N_CHECK_SAMPLES)
    return tuple(filter(None, (find_contradiction(few.predict(cut)) for cut in posterior.cuts if cut.has_verdict)))


def inconsistent_cut_remarks(posterior: Posterior, rejected: Sequence[InconsistentCut], about: str) -> Iterator[Remark]:
    """Yield remarks on rejected cuts and unusual frequencies; about: the program."""
    yield from map(_inconsistent_cut_remark, rejected)
    yield from _gain_remarks(posterior.drive_gain, about)
    if posterior.is_frequency_unusual:
        low, high = posterior.samples.usual_frequency_interval
        usual = f"{low:.3g} to {high:.3g} times that of the tap test"
        text = f"the frequency at speed from the test cuts is outside {usual}"
        yield Remark(
            "frequency-far-off", about, text, "Tap again with a warm spindle and the tool and stick-out of the cuts"
        )


def _gain_remarks(gain: Interval | None, about: str) -> Iterator[Remark]:
    """Yield the remark on a drive whose display contradicts stable and chattering cuts."""
    if gain is None or gain.low <= 1 <= gain.high or max(gain.mean, 1 / gain.mean) < drive_gain.MIN_DOUBTED_GAIN:
        return
    text = f"the drive shows {gain.mean:.2f} times the power of the cuts ({gain.low:.2f} to {gain.high:.2f})"
    cure = "Subtract the power in air, convert per cent to kW, and multiply mains power by the efficiency of the drive"
    yield Remark("drive-gain", about, text, cure)


def _repeats_of(cut: CutEvidence, posterior: Posterior) -> list[CutEvidence]:
    """Return the same cut as made at other times."""
    return [other for other in posterior.cuts if other is not cut and cut.is_repeat_of(other)]


def _inconsistent_cut_remark(contradicting: InconsistentCut) -> Remark:
    """Build the remark on a rejected cut."""
    cut = contradicting.cut
    if contradicting.contradiction is Contradiction.MATERIAL:
        return make_material_remark(cut.id, 1.0 if cut.power is None else cut.power.force)
    at = f"at {cut.speed_rpm:.6g} rpm, {LENGTH.text(1e3 * cut.depth, '.4g')}"
    pitch = f" at {cut.frequency:.0f} Hz" if math.isfinite(cut.frequency) else ""
    wrong = f"{100 * contradicting.wrong_probability:.0f} % likely wrong according to the other cuts"
    kind, exclude = (
        contradicting.contradiction,
        f"exclude the cut with folder_updates.exclude_entry MACHINE {cut.id} exclude_entry.reason TEXT",
    )
    text = {
        Contradiction.FREQUENCY: f"chatter{pitch} {at} (no tool mode at this frequency: workpiece or fixture?)",
        Contradiction.CHATTERS: f"chatter{pitch} {at} ({wrong}: entry error, workpiece, fixture or worn tool?)",
        Contradiction.STABLE: f"stable {at} ({wrong}: entry error, other depth or speed?)",
        Contradiction.POWER: f"power {at} contradicts the known Kt (misread, other feed or depth, worn edges?)",
    }[kind]
    cure = {
        Contradiction.FREQUENCY: "Tap the workpiece at the cut",
        Contradiction.CHATTERS: f"Repeat the cut, or {exclude}. If the cut chatters again, repeat the tap test.",
        Contradiction.STABLE: f"Repeat the cut, or {exclude}",
        Contradiction.POWER: f"Read the power again, or {exclude}. The stability of the cut still counts.",
    }[kind]
    return Remark("cut-unexplained", cut.id, f"not used: {text}", cure)
