"""Check hammer and accelerometer together: a hung mass must obey F = m a."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.arrays import AnyFloats, Complexes, Floats
from acquisition.channel import Channel
from acquisition.errors import Remark
from acquisition.estimation.estimate_frf import compute_cross_spectra, estimate_frf
from acquisition.hit import Hit
from acquisition.sensors.plausibility import unit_mistake_remark

MIN_CALIBRATION_FREQUENCY = 50.0
"""Lowest frequency used (Hz). Below it the pendulum (about 1 Hz) and the conditioner's high pass show."""
MAX_RATIO_DEVIATION = 0.05
"""Relative change of F/(m a) at which the band ends: mount or block resonate."""
RATIO_SMOOTHING_WIDTH = 200.0
"""Width over which F/(m a) is averaged to find the end of the band (Hz)."""
MIN_CALIBRATION_LINES = 20
"""Frequency lines needed in the band."""
MAX_SENSITIVITY_DEVIATION = 0.05
"""Accepted relative error of both sensitivities together. The stiffness K has the same error."""
MAX_RIGID_PHASE = 10.0
"""Largest phase of F/(m a) of a rigid mass (deg)."""


@dataclass(frozen=True)
class MassCalibration:
    """Result F/(m a) of a known mass. `str()` gives the results in sentences."""

    ratio: float
    """Ratio |F|/(m |a|) at low frequency, 1 if force and acceleration sensitivity agree."""
    ratio_std: float
    """Standard error of the ratio over the hits."""
    phase: float
    """Phase of a against F over the band, without the sign (deg)."""
    inverted: bool
    """True if force and acceleration have opposite signs."""
    flatness: float
    """Relative change of F/(m a) from low frequency to the end of the band."""
    band: tuple[float, float]
    """Band of the fit (Hz)."""
    mass: float
    """Total moving mass (kg)."""
    n_hits: int
    """Number of hits used."""
    channels: tuple[Channel, ...] | None = None
    """Force and acceleration channel, if known."""

    @property
    def agrees(self) -> bool:
        """True if both sensitivities together are right within 5 %, signs included."""
        return self.sizes_agree and not self.inverted

    @property
    def sizes_agree(self) -> bool:
        """True if both sensitivities together are right within 5 %, signs ignored."""
        return abs(self.ratio - 1) <= MAX_SENSITIVITY_DEVIATION

    @property
    def force_sensitivity(self) -> float | None:
        """Force sensitivity (V/N) if the accelerometer is right, None without channels."""
        return self.channels[0].sensitivity * self.ratio if self.channels else None

    @property
    def acceleration_sensitivity(self) -> float | None:
        """Acceleration sensitivity (V per m/s^2) if the hammer is right, None without channels."""
        return self.channels[1].sensitivity / self.ratio if self.channels else None

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on faults, empty if the mass is rigid and both sensitivities agree."""
        return tuple(self._find_faults())

    def _find_faults(self) -> Iterator[Remark]:
        if abs(self.phase) > MAX_RIGID_PHASE:
            text = f"the phase of F/(m a), {self.phase:+.1f} deg, is too large for a rigid mass"
            cure = "Measure the channel skew, and hit in line with the accelerometer and the centre of the mass"
            yield Remark("phase-not-rigid", "", text, cure)
        if self.inverted:
            cure = "Turn the accelerometer round, or change the sign of its sensitivity"
            yield Remark("opposite-signs", "", "force and acceleration have opposite signs", cure)
        if self.sizes_agree:
            return
        large, share = ("force", self.ratio - 1) if self.ratio > 1 else ("acceleration", 1 / self.ratio - 1)
        much = f"{share:.1%} too large" if share < 1 else f"{1 + share:.4g} times too large"
        wrong = "large" if self.ratio > 1 else "small"
        small = "acceleration" if self.ratio > 1 else "force"
        text = f"the {large} is {much} compared with the {small}, so every stiffness K is too {wrong}"
        cure = "Check that the given mass is the total moving mass, with accelerometer and mount"
        yield Remark("sensitivities-disagree", "", text, cure)
        if mistake := unit_mistake_remark(self.ratio):
            yield mistake

    def __str__(self) -> str:
        """Return all results, one sentence per line."""
        low, high = self.band
        lines = [
            f"F/(m a) = {self.ratio:.4f} ± {self.ratio_std:.4f} (standard error), "
            f"{self.n_hits} hits on {self.mass:g} kg",
            f"F/(m a) is constant within {abs(self.flatness):.1%} from {low:.0f} to {high:.0f} Hz, "
            f"phase {self.phase:+.1f} deg",
            *map(str, self.remarks),
        ]
        if self.sizes_agree:
            lines.append(f"The sensitivities of hammer and accelerometer agree within {MAX_SENSITIVITY_DEVIATION:.0%}.")
        elif self.channels is not None:
            old = [channel.sensitivity * 1e3 for channel in self.channels]
            force = f"the hammer has {old[0] * self.ratio:.4g} mV/N instead of {old[0]:.4g} mV/N"
            response = f"the accelerometer has {old[1] / self.ratio:.4g} mV per m/s^2 instead of {old[1]:.4g}"
            lines.append(f"If the accelerometer is right, {force}.")
            lines.append(f"If the hammer is right, {response}.")
        return "\n".join(lines)


def calibrate_by_mass(hits: Sequence[Hit], mass: float) -> MassCalibration:
    """Check both sensitivities with good hits on a freely hung rigid mass.

    Per hit, m A = (q0 + q2 f^2) F is fitted by least squares weighted with |F|^2, from 50 Hz to the frequency where the
    force has dropped by 20 dB or F/(m a) has changed by 5 %. q2 models the mount resonance f_m,
    A ~ 1/(1 - (f/f_m)^2). The ratio is 1/q0, so that noise on the acceleration averages out.

    Parameters
    ----------
    hits
        Good hits, at least 3.
    mass
        Total moving mass, accelerometer included (kg).

    Returns
    -------
    MassCalibration
        Ratio F/(m a) and conclusions.

    Raises
    ------
    ValueError
        The mass is not > 0, there are fewer than 3 hits, they differ in length or rate, or fewer than 20 lines of the
        band are left.

    References
    ----------
    ISO 7626-5, calibration by a mass.

    Examples
    --------
    A mass of 2 kg whose accelerometer shows 3 % too little:

    >>> random, time = np.random.default_rng(1), np.arange(2048) / 10240.0
    >>> hits = []
    >>> for peak in (100.0, 120.0, 140.0):  # N
    ...     force = np.where(abs(time - 0.02) < 5e-4, peak * np.cos(np.pi * (time - 0.02) / 1e-3), 0.0)
    ...     hits.append(Hit(force, force / 2.0 * 0.97 + random.normal(0.0, 0.01, 2048), 10240.0, pre_trigger=200))
    >>> checked = calibrate_by_mass(hits, mass=2.0)
    >>> f"{checked.ratio:.3f}", round(1 / 0.97, 3), checked.agrees
    ('1.031', 1.031, True)
    """
    if not (np.isfinite(mass) and mass > 0):
        raise ValueError(f"mass={mass} kg is not above 0. Give the total moving mass, accelerometer included.")
    if len(hits) < 3:
        raise ValueError(f"{len(hits)} good hits are too few. Hit the mass at least 3 times.")
    upper = (estimate_frf(hits).usable_band or (0.0, 0.0))[1]
    frequency = np.fft.rfftfreq(hits[0].force.size, 1 / hits[0].sample_rate)
    inside = (frequency >= MIN_CALIBRATION_FREQUENCY) & (frequency <= upper)
    spectra = [compute_cross_spectra([hit]) for hit in hits]
    s_ff = np.array([force[inside] for force, _, _ in spectra])
    s_fa = mass * np.array([cross[inside] for _, _, cross in spectra])
    n = _count_flat_lines(frequency[inside], s_ff.sum(axis=0), s_fa.sum(axis=0))
    if n < MIN_CALIBRATION_LINES:
        lines = f"{n} FRF lines from {MIN_CALIBRATION_FREQUENCY:g} Hz on, {MIN_CALIBRATION_LINES} are required"
        cure = "Hang the mass on long thin threads, screw the accelerometer on, hit harder, or record longer."
        raise ValueError(f"force and acceleration have no constant ratio ({lines}). {cure}")
    f, s_ff, s_fa = frequency[inside][:n], s_ff[:, :n], s_fa[:, :n]
    sign = float(np.sign(np.sum(s_fa).real))
    fits = np.array([_fit_ratio(f, force, sign * cross.real) for force, cross in zip(s_ff, s_fa, strict=True)])
    q0, q2 = np.mean(fits, axis=0)
    return MassCalibration(
        ratio=float(np.mean(1 / fits[:, 0])),
        ratio_std=float(np.std(1 / fits[:, 0], ddof=1) / np.sqrt(len(hits))),
        phase=float(np.angle(sign * np.sum(s_fa), deg=True)),
        inverted=sign < 0,
        flatness=float(q0 / (q0 + q2 * f[-1] ** 2) - 1),
        band=(float(f[0]), float(f[-1])),
        mass=mass,
        n_hits=len(hits),
        channels=hits[0].channels,
    )


def _count_flat_lines(f: AnyFloats, s_ff: Floats, s_fa: Complexes) -> int:
    """Return the number of lines before m A/F leaves its initial value by 5 %."""
    if f.size < MIN_CALIBRATION_LINES:
        return f.size
    near = max(MIN_CALIBRATION_LINES, round(RATIO_SMOOTHING_WIDTH / (f[1] - f[0])))
    window = np.ones(min(near, f.size))
    smooth = np.convolve(s_fa, window, "same") / np.convolve(s_ff, window, "same")
    start = s_fa[:near].sum() / s_ff[:near].sum()
    off = np.flatnonzero(np.abs(np.abs(smooth / start) - 1) > MAX_RATIO_DEVIATION)
    return int(off[0]) if off.size else f.size


def _fit_ratio(f: AnyFloats, s_ff: Floats, s_fa: Floats) -> Floats:
    """Return q0 and q2 of m A = (q0 + q2 f^2) F, least squares weighted with |F|^2."""
    root = np.sqrt(s_ff)
    rows = np.stack([root, root * (f / f[-1]) ** 2], axis=1)
    return np.asarray(np.linalg.lstsq(rows, s_fa / root)[0] / [1, f[-1] ** 2])
