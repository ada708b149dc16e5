"""Prior samples of the rotating spindle.

f_n drops by the range of `[speed] drop_percent` (0 to 5 % if nothing is set), for each mode apart, as cuts tell modes
apart. Standard deviations: zeta x 1.1 +- 25 %, K +- 10 %, for x and y apart; Kt x 1.1 +- 30 % (10 % if listed), for
each material. Kr/Kt may be anything from 0 to 1, more likely what the program is doubted by. The process damping
coefficient C is that of `ProcessDamping`, for each material. Chosen: plausible, not measured. They are joined with the
uncertainty of the program. Each number is a function of one that is standard normal, so that samples can be moved
without leaving the prior out of sight.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy

from lobes import MillingRows
from lobes.coefficient_distribution import Quantiles
from lobewatch.arrays import Floats, Indices
from lobewatch.cuts.learning.process_damping import MAX_PROCESS_DAMPING, NO_PROCESS_DAMPING, ProcessDamping
from lobewatch.verdicts import program_samples
from lobewatch.verdicts.speed_drop import DEFAULT_DROP, SpeedDrop
from lobewatch.verdicts.uncertainty import Uncertainty, scale_fields

ROTATING_FORCE_PRIOR = (1.1, program_samples.ROTATING_FORCE_SPREAD)
"""Mean and relative standard deviation of Kt at speed over that of the table; the mean is chosen.

Listed materials have the standard deviation of `program_samples.force_spread`. Damping and stiffness are those of the
chatter risk of a verdict."""
DROP_SPREAD_SHARE, MIN_DROP_SPREAD = 0.8, 0.01
"""Standard deviation of the drop over half of its range, and at least, so that cuts may contradict it; chosen."""
WIDE_FREQUENCY_SHARE, WIDE_FREQUENCY_FACTOR = 0.05, 3.0
"""Share of frequencies that differ more, and factor on their deviation; chosen, as no measurements exist."""
MIN_PRIOR_SHARE = 0.5
"""Smallest share of a mode in the standard deviation of the drop: models of spindles are uncertain; chosen."""
MAX_SAMPLED_DAMPING = 0.95
"""Largest sampled damping ratio; modes stay underdamped."""
OPEN_FORCE_RATIO_SHARE = 0.3
"""Share of samples with any Kr/Kt from 0 to 1, whatever is published; chosen."""
NUMBERS_PER_SPINDLE, NUMBERS_PER_MATERIAL = 4, 3
"""Number of values of a sample for the spindle and for each material, beyond f of each mode.

Spindle: (zeta, K) in x, then in y. Material: Kt at speed, uncertain Kt, uncertain Kr/Kt, then C if it is open."""
MIXTURE_TABLE_END, MIXTURE_TABLE_POINTS = 18, 3601
"""End (standard deviations) and number of points of the mixture table of `_mixture_quantiles`."""


@dataclass(frozen=True, eq=False)
class SpindleSamples:
    """Samples of the spindle at speed: drawn numbers, and the rows of a cut that follow."""

    normal: Floats
    """Standard normal numbers for the differences from the spindle not rotating, shape (r, modes + 4 + 3 materials).

    With 4 for each material where process damping is open."""
    at_rest: MillingRows
    """Spindles not rotating with the error of tap tests, r rows; their speeds are factors on the commanded one."""
    uncertainty: Uncertainty
    """Uncertainty that the coefficients were drawn from."""
    drop: SpeedDrop = DEFAULT_DROP
    """Frequency drop at speed before the cuts."""
    damping: ProcessDamping = NO_PROCESS_DAMPING
    """Process damping before the cuts."""

    def __len__(self) -> int:
        return len(self.normal)

    def __getitem__(self, places: Indices | slice) -> "SpindleSamples":
        return replace(self, normal=self.normal[places], at_rest=self.at_rest[places])

    def with_materials(self, count: int, seed: int) -> "SpindleSamples":
        """Add cutting coefficients from the prior until there are `count` materials."""
        width = NUMBERS_PER_MATERIAL + self.damping.is_open
        missing = (self._material_index(count) - self.normal.shape[1]) // width
        if missing <= 0:
            return self
        shape = len(self), missing, NUMBERS_PER_MATERIAL
        more = np.random.default_rng((seed, 5, count)).standard_normal(shape)
        if self.damping.is_open:
            damping = np.random.default_rng((seed, 6, count)).standard_normal((len(self), missing, 1))
            more = np.concatenate((more, damping), axis=2)
        return replace(self, normal=np.hstack((self.normal, more.reshape(len(self), -1))))

    def ratios(self) -> dict[str, Floats]:
        """Return all learned factors by name: f, zeta and K of "x" and "y", Kt and Kr/Kt of material 0, (r,) each.

        "process_damping" is C of material 0 over `MAX_PROCESS_DAMPING`, where it is open.

        "frequency_x" is that of the mode in x which gives way most, "frequency_x_2" of the next.
        """
        at_rest = self.at_rest
        tangential, ratio = self._coefficient_factors(0, float(at_rest.tangential[0]), float(at_rest.radial[0]))
        frequency, sides = self._frequency_factors(), self._side_factors()
        soft = np.mean(1 / (2 * at_rest.damping_ratio * at_rest.stiffness), axis=0)
        values = {"tangential": tangential, "ratio": ratio}
        if self.damping.is_open:
            values["process_damping"] = self.process_damping(0) / MAX_PROCESS_DAMPING
        for axis, side in enumerate("xy"):
            modes = np.flatnonzero(at_rest.axes[at_rest.direction] == axis)
            for place, mode in enumerate(modes[np.argsort(-soft[modes], kind="stable")], 1):
                values[f"frequency_{side}" + (f"_{place}" if place > 1 else "")] = frequency[:, mode]
            if modes.size:
                values |= {f"damping_{side}": sides[:, axis, 0], f"stiffness_{side}": sides[:, axis, 1]}
        return values

    def force_factors(self, material: int) -> Floats:
        """Return the factors of Kt of a material, with the largest wear for the largest Kt, shape (r,)."""
        mean, spread = ROTATING_FORCE_PRIOR[0], program_samples.force_spread(self.uncertainty)
        at_speed = 1 + spread * self.normal[:, self._material_index(material)]
        shares = self._coefficient_shares(material)
        force, _ = self.uncertainty.coefficient_factors(shares)
        worn = 1 + (self.uncertainty.wear - 1) * shares[0]
        return np.asarray(mean * np.maximum(at_speed, program_samples.MIN_ROTATING_FACTOR) * force * worn)

    def process_damping(self, material: int) -> Floats:
        """Return the process damping coefficients C of a material (N/m), shape (r,)."""
        if not self.damping.is_open:
            return np.full(len(self), self.damping.low)
        normal = self.normal[:, self._material_index(material) + NUMBERS_PER_MATERIAL]
        return self.damping.quantiles(scipy.special.ndtr(normal))

    def build_rows(self, speed_rpm: float, tangential: float, radial: float, material: int = 0) -> MillingRows:
        """Build spindles with a cut of these coefficients (Pa) at a true speed (rpm), fed along x."""
        at_side = self._side_factors()[:, self.at_rest.axes[self.at_rest.direction]]
        push, ratio = self._coefficient_factors(material, tangential, radial)
        f, zeta, k = self._frequency_factors(), at_side[..., 0], at_side[..., 1]
        rows = scale_fields(self.at_rest, frequency=f, damping_ratio=zeta, stiffness=k)
        rows = replace(rows, damping_ratio=np.minimum(rows.damping_ratio, MAX_SAMPLED_DAMPING))
        speeds, force = np.full(len(self), speed_rpm), tangential * push
        damping = self.process_damping(material) / self.damping.diameter
        return replace(rows, speed_rpm=speeds, tangential=force, radial=radial * push * ratio, process_damping=damping)

    def _material_index(self, material: int) -> int:
        """Place of the first number of a material."""
        return (
            self.at_rest.direction.size + NUMBERS_PER_SPINDLE + (NUMBERS_PER_MATERIAL + self.damping.is_open) * material
        )

    def _frequency_factors(self) -> Floats:
        """Factors of f of each mode, shape (r, n)."""
        mean, spread = self._frequency_prior()
        normal = self.normal[:, : self.at_rest.direction.size]
        return np.asarray(mean + spread * np.interp(normal, *_mixture_quantiles()))

    def _frequency_prior(self) -> tuple[Floats, Floats]:
        """Return mean and standard deviation of the factors of f of each mode, or (1,) each if they are alike."""
        half = (self.drop.high - self.drop.low) / 2
        spread = max(DROP_SPREAD_SHARE * half, MIN_DROP_SPREAD) * np.maximum(self.drop.shares, MIN_PRIOR_SHARE)
        return 1 - (self.drop.low + half) * self.drop.shares, spread

    @property
    def usual_frequency_interval(self) -> tuple[float, float]:
        """95 % interval of natural frequencies at speed over those not rotating, before the cuts."""
        mean, spread = self._frequency_prior()
        return float(np.min(mean - 2 * spread)), float(np.max(mean + 2 * spread))

    def _side_factors(self) -> Floats:
        """Factors of zeta and K in x and y, shape (r, 2, 2)."""
        first = self.at_rest.direction.size
        normal = self.normal[:, first : first + NUMBERS_PER_SPINDLE].reshape(-1, 2, 2)
        priors = program_samples.ROTATING_DAMPING_FACTOR, program_samples.ROTATING_STIFFNESS_FACTOR
        median, spread = np.array(priors).T
        return np.asarray(median * np.maximum(1 + spread * normal, program_samples.MIN_ROTATING_FACTOR))

    def _coefficient_factors(self, material: int, tangential: float, radial: float) -> tuple[Floats, Floats]:
        """Factors of Kt and of Kr/Kt of a material with these coefficients (Pa), shape (r,) each."""
        quantiles, shares = _ratio_quantiles(self.uncertainty, radial / tangential), self._coefficient_shares(material)
        joint = self.uncertainty.joint
        share = shares[1] if joint is None else joint.shares(shares)[1]
        return self.force_factors(material), np.maximum(quantiles.at(share), 0.0)

    def _coefficient_shares(self, material: int) -> Floats:
        """Independent even probabilities of Kt and Kr/Kt of a material, shape (2, r)."""
        first = self._material_index(material) + 1
        return np.asarray(scipy.special.ndtr(self.normal[:, first : first + 2]).T)


def sample_prior(
    median: MillingRows,
    uncertainty: Uncertainty,
    count: int,
    seed: int = 0,
    drop: SpeedDrop = DEFAULT_DROP,
    damping: ProcessDamping = NO_PROCESS_DAMPING,
) -> SpindleSamples:
    """Sample the prior around a spindle that does not rotate (a row), reproducible by seed."""
    at_rest = uncertainty.sample(replace(median, speed_rpm=np.ones(1)), count, seed, without="coefficients")
    size = count, median.direction.size + NUMBERS_PER_SPINDLE + NUMBERS_PER_MATERIAL
    normal = np.random.default_rng((seed, 2)).standard_normal(size)
    if damping.is_open:
        normal = np.hstack((normal, np.random.default_rng((seed, 6)).standard_normal((count, 1))))
    return SpindleSamples(normal, at_rest, uncertainty, drop, damping)


def _ratio_quantiles(uncertainty: Uncertainty, median: float) -> Quantiles:
    """Return the quantiles of the factors of Kr/Kt: published, or with some probability anywhere from 0 to 1.

    A Kr of 0 stays as uncertain.
    """
    low, high = uncertainty.ratio
    near = Quantiles.even(low, high) if uncertainty.joint is None else uncertainty.joint.ratio
    return near if median <= 0 else near.mix(Quantiles.even(0.0, 1 / median), OPEN_FORCE_RATIO_SHARE)


@cache
def _mixture_quantiles() -> tuple[Floats, Floats]:
    """Return standard normal numbers and the mixture quantiles of the same probabilities."""
    value = np.linspace(-MIXTURE_TABLE_END, MIXTURE_TABLE_END, MIXTURE_TABLE_POINTS)
    usual, wide = scipy.special.ndtr(-np.abs(value)), scipy.special.ndtr(-np.abs(value) / WIDE_FREQUENCY_FACTOR)
    beyond = (1 - WIDE_FREQUENCY_SHARE) * usual + WIDE_FREQUENCY_SHARE * wide
    return np.asarray(-np.sign(value) * scipy.special.ndtri(beyond)), value
