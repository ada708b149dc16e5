"""Effects of the measurement on modes: exponential window, channel delay, added mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Frf
from modal.arrays import Floats
from modal.modes.mode import Mode, ratio_or_zero


def remove_window(mode: Mode, time_constant: float, delay: float = 0.0) -> Mode:
    """The mode without the exponential window exp(-t/time_constant) (s) that the response was recorded with.

    The window adds 1/time_constant to the decay rate zeta w_n and leaves the damped frequency and the strength of
    the free decay as they are: zeta falls by 1/(w_n time_constant), to first order, and K follows w_n^2. Standard
    errors are carried over. A remark that lines were smoothed goes: that was the window.

    delay: time from the start of the window to the hit (s), the centre of the pulse. By then the window has fallen to
    exp(-delay/time_constant), so that all of the response is smaller by that and K is larger: it is taken off as well.
    0 where the window begins at the hit, or lies over the force, too.

    Of a windowed acceleration K comes out too large by a further 2 zeta/(w_n time_constant) of itself, a few parts in
    ten thousand, unless `correct_windowed_receptance` has divided by the s^2 that belongs to it.

    Raises ValueError for a time constant that is not > 0, for a delay that is not finite and >= 0, and for a mode that
    decays no faster than the window.
    Source: Fladung & Rost (1997), Application and correction of the exponential window for FRFs, Mechanical Systems
    and Signal Processing 11, 23.

    >>> windowed = Mode(500.0, 0.02 + 1 / (2 * np.pi * 500.0 * 0.1), 2e7)  # exp(-t / 0.1 s) over the response
    >>> round(remove_window(windowed, 0.1).damping_ratio, 4)
    0.02
    """
    if not (np.isfinite(time_constant) and time_constant > 0):
        raise ValueError(f"time_constant={time_constant} s is not a finite number > 0")
    if not (np.isfinite(delay) and delay >= 0):
        raise ValueError(f"delay={delay} s is not a finite number >= 0: the window cannot begin after the hit")
    size = 2 * np.pi * mode.frequency
    decay = mode.damping_ratio * size - 1 / time_constant
    if decay <= 0:
        raise ValueError(
            f"the mode at {mode.frequency:.1f} Hz decays with {decay + 1 / time_constant:.3g}/s, no faster than the "
            f"window, {1 / time_constant:.3g}/s: the time constant is not that of its window; look it up"
        )
    w = float(np.hypot(decay, size * np.sqrt(1 - mode.damping_ratio**2)))
    left = float(np.exp(-delay / time_constant))
    slope = np.diag([1, 1, left]) @ _window_jacobian(mode, time_constant, size, decay, w)
    covariances = [c if c is None else slope @ c @ slope.T for c in (mode.covariance, mode.jackknife)]
    return replace(
        mode,
        frequency=w / (2 * np.pi),
        damping_ratio=decay / w,
        stiffness=mode.stiffness * (w / size) ** 2 * left,
        covariance=covariances[0],
        jackknife=covariances[1],
        phase_correlation=_phase_correlation(mode, slope),
        remarks=tuple(remark for remark in mode.remarks if remark.code != "smoothed-lines"),
        method=f"{mode.method}, without the window of {time_constant:g} s",
    )


def widen_for_window(mode: Mode, time_constant: float, record: float) -> Mode:
    """The mode with its covariance from the fit widened by what a window over a record (s) does to white noise.

    Under the window the noise of neighbouring lines is alike: of the values of a record of length T as many are
    independent as the share (integral of w^2)^2 / (T integral of w^4) says, 1 for no window and time_constant/T for a
    short one. A fit takes them all for independent. What the scatter of the hits says holds anyhow.

    Source: Harris (1978), On the use of windows for harmonic analysis, Proc. IEEE 66, 51 (noise bandwidth).

    >>> mode = Mode(500.0, 0.02, 2e7, covariance=np.diag([0.1, 0.001, 1e5]) ** 2)
    >>> widened = widen_for_window(mode, time_constant=0.05, record=0.8)  # s
    >>> (widened.fit_error / mode.fit_error).round(2).tolist()  # sqrt(record / time constant) = 4
    [4.0, 4.0, 4.0]
    """
    if mode.covariance is None:
        return mode
    factor = _window_widening(record / time_constant)
    of_phase = mode.phase_deg_std * (np.sqrt(factor) if mode.jackknife is None else 1.0)
    covariance, freedom = mode.covariance * factor, mode.degrees_of_freedom / factor
    return replace(mode, covariance=covariance, degrees_of_freedom=freedom, phase_deg_std=float(of_phase))


def _window_widening(a: float) -> float:
    """T (integral of w^4) / (integral of w^2)^2 of w = exp(-a t/T) from 0 to T."""
    return float(a * np.expm1(-4 * a) / -(np.expm1(-2 * a) ** 2))


def _phase_correlation(mode: Mode, slope: Floats) -> Floats | None:
    """Of the error of the phase, which stays as it is, with those of the values without the window."""
    if mode.phase_correlation is None or mode.best_covariance is None:
        return mode.phase_correlation
    error = np.sqrt(np.diag(slope @ mode.best_covariance @ slope.T))
    return ratio_or_zero(slope @ (mode.phase_correlation * mode.standard_error), error)


def _window_jacobian(mode: Mode, tau: float, size: float, decay: float, w: float) -> Floats:
    """Of frequency, damping ratio and stiffness without the window by those with it, shape (3, 3).

    w^2 = size^2 - 2 zeta size/tau + 1/tau^2.
    """
    by_size, by_zeta = (size - mode.damping_ratio / tau) / w, -size / tau / w
    k = 2 * mode.stiffness * w / size**2
    slope = np.array(
        [
            [by_size, by_zeta, 0],
            [mode.damping_ratio / w - decay / w**2 * by_size, size / w - decay / w**2 * by_zeta, 0],
            [k * (by_size - w / size), k * by_zeta, (w / size) ** 2],
        ]
    )
    hertz = np.diag([2 * np.pi, 1, 1])
    return np.asarray(np.linalg.inv(hertz) @ slope @ hertz)


MIN_MODES_FOR_COMMON_DECAY, MIN_COMMON_DECAY_SPAN = 4, 3.0
"""Modes that agree, and the ratio of their highest frequency to the lowest, at least."""
MAX_DECAY_RATE_SPREAD = 0.2
"""Standard deviation of the logarithms of their decay rates up to which these are alike; chosen. Over a span of 3 those
of equal damping ratios have 0.4 or more."""


def common_decay_rate(modes: Sequence[Mode]) -> float | None:
    """Decay rate zeta w (1/s) that all these modes have about; None where they do not, or are too few to tell.

    Structures damp their modes by about equal damping ratios, so that decay rates grow with frequency. Under a window
    exp(-t/tau) that is shorter than their decay all rates are 1/tau, and damping ratios fall as 1/f.

    >>> windowed = [Mode(f, 1 / (0.05 * 2 * np.pi * f), 2e7) for f in (500.0, 900.0, 1300.0, 1900.0)]  # zeta w = 1/tau
    >>> round(1 / common_decay_rate(windowed), 4)  # s: the time constant of the window
    0.05
    >>> common_decay_rate([Mode(f, 0.02, 2e7) for f in (500.0, 900.0, 1300.0, 1900.0)]) is None
    True
    """
    if len(modes) < MIN_MODES_FOR_COMMON_DECAY:
        return None
    frequency = np.log([mode.frequency for mode in modes])
    rate = np.log([2 * np.pi * mode.damping_ratio * mode.frequency for mode in modes])
    are_alike = np.ptp(frequency) > np.log(MIN_COMMON_DECAY_SPAN) and np.std(rate) < MAX_DECAY_RATE_SPREAD
    return float(np.exp(np.mean(rate))) if are_alike else None


REAL_MODE_PHASE_SCATTER_DEG = 2.0
"""Phases of the modes of a lightly damped structure scatter about 0 by this (degrees)."""
MIN_DELAY_PHASE_DEG = 5.0
"""A delay counts from this phase on, at the highest mode (degrees) ..."""
MIN_MODES_FOR_COMMON_DELAY = 3
"""... where so many modes agree ..."""
MAX_DELAY_CHI_SQUARE = 4.0
"""... and it leaves a sum of squares (in their errors) below this many times the number of modes less one ..."""
MAX_DELAY_RESIDUAL_SHARE = 0.1
"""... and below this share of what there was without it."""


@dataclass(frozen=True)
class CommonDelay:
    """A delay that explains the phases of all modes."""

    skew: float
    """The response is sampled so much later than the force (s); the value for `Channel.skew`."""
    skew_std: float
    """Standard error (s)."""

    def phase_deg(self, frequency: float) -> float:
        """The phase that it gives a real mode at this frequency (Hz)."""
        return 360 * frequency * self.skew


def common_delay(modes: Sequence[Mode]) -> CommonDelay | None:
    """The delay whose phase, linear in frequency, is that of all modal constants; None where they have none in common.

    A response that is sampled later than the force leads by 2 pi f skew on every line; complex modes follow no such
    line. Three modes at least.

    >>> late = 20e-6  # s: a converter that takes its channels one after the other
    >>> modes = [Mode(f, 0.02, 2e7, phase_deg=360.0 * f * late) for f in (500.0, 900.0, 1300.0)]
    >>> round(common_delay(modes).skew * 1e6, 2)  # us
    20.0
    """
    if len(modes) < MIN_MODES_FOR_COMMON_DELAY:
        return None
    frequency = np.array([mode.frequency for mode in modes])
    error = np.hypot([mode.phase_deg_std for mode in modes], REAL_MODE_PHASE_SCATTER_DEG)
    turn, phase = 360 * frequency / error, np.array([mode.phase_deg for mode in modes]) / error
    skew, std = float(turn @ phase / (turn @ turn)), float(1 / np.linalg.norm(turn))
    left = float(np.sum((phase - turn * skew) ** 2))
    explains = left < MAX_DELAY_CHI_SQUARE * (len(modes) - 1) and left < MAX_DELAY_RESIDUAL_SHARE * float(phase @ phase)
    is_clear = abs(360 * skew) * frequency.max() > MIN_DELAY_PHASE_DEG and abs(skew) > 3 * std
    return CommonDelay(skew, std) if explains and is_clear else None


MASKED_HALF_WIDTHS = 2.0
"""Half-power half-widths to either side of a mode at which it hides others less than on its peak."""


@dataclass(frozen=True)
class MassLoading:
    """Relative changes of a mode when a mass is put on, to first order."""

    frequency: float
    """Change of the natural frequency (-), < 0."""
    stiffness: float
    """Change of the modal stiffness (-)."""


def mass_loading(mode: Mode, frf: Frf, mass: float) -> MassLoading:
    """Change of a mode by a mass (kg) at the driving point whose FRF this is.

    With the modal mass M = K/w^2 the frequency falls by mass/(2 M). K follows the shape, which the mass bends towards
    the other modes: -2 mass w^2 R of itself, R the receptance at w of all others, those outside the lines, too.
    Source: first-order perturbation of K phi = w^2 M phi by mass e e^T, e.g. Ewins, Modal Testing, ch. 2.

    A sensor of 20 g on a single mode of K = 20 N/um at 500 Hz, M = K / w^2 = 2.03 kg: -m / (2 M)

    >>> mode = Mode(500.0, 0.02, 2e7)
    >>> loading = mass_loading(mode, synthesize_frf([mode], np.arange(1.0, 1501.0)), 0.02)
    >>> f"{100 * loading.frequency:.2f} %, {100 * -0.02 * (2 * np.pi * 500.0) ** 2 / 2e7 / 2:.2f} %"
    '-0.49 %, -0.49 %'
    """
    w2 = (2 * np.pi * mode.frequency) ** 2
    places = mode.frequency * (1 + MASKED_HALF_WIDTHS * mode.damping_ratio * np.array([-1, 1]))
    lines = np.argmin(np.abs(frf.frequency[:, np.newaxis] - places), axis=0)
    others = np.mean(frf.receptance[lines] - mode.receptance(frf.frequency[lines]))
    return MassLoading(-0.5 * mass * w2 / mode.stiffness, float(-2 * mass * w2 * others.real))


def with_mass_uncertainty(mode: Mode, frf: Frf, mass_std: float) -> Mode:
    """The mode with what it may be off by because the mass that was taken off is known to a standard error (kg).

    >>> mode = Mode(500.0, 0.02, 2e7, covariance=np.diag([0.1, 0.001, 1e5]) ** 2)
    >>> doubted = with_mass_uncertainty(mode, synthesize_frf([mode], np.arange(1.0, 1501.0)), mass_std=2e-3)
    >>> round(float(mode.fit_error[0]), 3), round(float(doubted.fit_error[0]), 3)  # Hz: 2 g are 0.25 Hz
    (0.1, 0.266)
    """
    loading = mass_loading(mode, frf, mass_std)
    off = loading.frequency * mode.frequency, loading.frequency * mode.damping_ratio, loading.stiffness * mode.stiffness
    more = np.outer(off, off)

    def widened(covariance: Floats | None) -> Floats | None:
        return None if covariance is None else covariance + more

    return replace(mode, covariance=widened(mode.covariance), jackknife=widened(mode.jackknife))
