"""Effects of the measurement on modes: exponential window, channel delay, added mass."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Frf
from modal.arrays import Floats
from modal.modes.mode import Mode, change_covariances, ratio_or_zero


def remove_window(mode: Mode, time_constant: float, delay: float = 0.0) -> Mode:
    """Remove the effect of an exponential window on the response from a mode.

    The window exp(-t/time_constant) adds 1/time_constant to the decay rate zeta w_n and changes neither the damped
    frequency nor the strength of the free decay: zeta falls by 1/(w_n time_constant), to first order, and K follows
    w_n^2. Standard errors are carried over. A remark on smoothed lines goes: that was the window.

    Parameters
    ----------
    mode : Mode
        Mode of the windowed response.
    time_constant : float
        Time constant of the window (s).
    delay : float
        Time from the start of the window to the centre of the pulse (s). The window has dropped to
        exp(-delay/time_constant) by then, which makes K larger; this is removed, too. 0 if the window begins at the
        hit,
        or covers the force, too.

    Returns
    -------
    Mode
        Mode without the window.

    Raises
    ------
    ValueError
        For a time constant that is not > 0, a delay that is not finite and >= 0, and a mode that decays no faster than
        the window.

    Notes
    -----
    For a windowed acceleration K is too large by a further 2 zeta/(w_n time_constant), a few parts in
    ten thousand, unless `correct_windowed_receptance` has divided by the matching s^2.

    References
    ----------
    Fladung & Rost (1997), Application and correction of the exponential window for FRFs, Mechanical Systems
    and Signal Processing 11, 23.

    Examples
    --------
    >>> windowed = Mode(500.0, 0.02 + 1 / (2 * np.pi * 500.0 * 0.1), 2e7)  # exp(-t / 0.1 s) over the response
    >>> round(remove_window(windowed, 0.1).damping_ratio, 4)
    0.02
    """
    if not (np.isfinite(time_constant) and time_constant > 0):
        raise ValueError(f"time_constant={time_constant} s is not a finite number > 0")
    if not (np.isfinite(delay) and delay >= 0):
        raise ValueError(f"delay={delay} s is not a finite number >= 0. The window must begin before the hit.")
    size = 2 * np.pi * mode.frequency
    decay = mode.damping_ratio * size - 1 / time_constant
    if decay <= 0:
        raise ValueError(
            f"the mode at {mode.frequency:.1f} Hz decays at {decay + 1 / time_constant:.3g}/s, no faster than the "
            f"window ({1 / time_constant:.3g}/s). Check the time constant of the window."
        )
    w = float(np.hypot(decay, size * np.sqrt(1 - mode.damping_ratio**2)))
    left = float(np.exp(-delay / time_constant))
    slope = np.diag([1, 1, left]) @ _window_jacobian(mode, time_constant, size, decay, w)
    return replace(
        change_covariances(mode, lambda covariance: np.asarray(slope @ covariance @ slope.T)),
        frequency=w / (2 * np.pi),
        damping_ratio=decay / w,
        stiffness=mode.stiffness * (w / size) ** 2 * left,
        phase_correlation=_phase_correlation(mode, slope),
        remarks=tuple(remark for remark in mode.remarks if remark.code != "smoothed-lines"),
        method=f"{mode.method}, without the window of {time_constant:g} s",
    )


def widen_for_window(mode: Mode, time_constant: float, record: float) -> Mode:
    """Widen the fit covariance of a mode by the effect of a window on white noise.

    Under the window the noise of neighbouring lines is correlated: the share of independent values in a record of
    length T is (integral of w^2)^2 / (T integral of w^4), 1 without a window and time_constant/T for a
    short one. A fit takes all values as independent. The scatter of the hits needs no correction.

    Parameters
    ----------
    mode : Mode
        Fitted mode.
    time_constant : float
        Time constant of the window (s).
    record : float
        Record length (s).

    Returns
    -------
    Mode
        Mode with wider covariance.

    References
    ----------
    Harris (1978), On the use of windows for harmonic analysis, Proc. IEEE 66, 51 (noise bandwidth).

    Examples
    --------
    >>> mode = Mode(500.0, 0.02, 2e7, covariance=np.diag([0.1, 0.001, 1e5]) ** 2)
    >>> widened = widen_for_window(mode, time_constant=0.05, record=0.8)  # s
    >>> (widened.fit_error / mode.fit_error).round(2).tolist()  # sqrt(record / time constant) = 4
    [4.0, 4.0, 4.0]
    """
    if mode.covariance is None:
        return mode
    a = record / time_constant
    factor = float(a * np.expm1(-4 * a) / -(np.expm1(-2 * a) ** 2))
    of_phase = mode.phase_deg_std * (np.sqrt(factor) if mode.jackknife is None else 1.0)
    covariance, freedom = mode.covariance * factor, mode.degrees_of_freedom / factor
    return replace(mode, covariance=covariance, degrees_of_freedom=freedom, phase_deg_std=float(of_phase))


def _phase_correlation(mode: Mode, slope: Floats) -> Floats | None:
    """Return the correlations of the unchanged phase error with those of the values without the window."""
    if mode.phase_correlation is None or mode.best_covariance is None:
        return mode.phase_correlation
    error = np.sqrt(np.diag(slope @ mode.best_covariance @ slope.T))
    return ratio_or_zero(slope @ (mode.phase_correlation * mode.standard_error), error)


def _window_jacobian(mode: Mode, tau: float, size: float, decay: float, w: float) -> Floats:
    """Return the Jacobian of frequency, damping ratio and stiffness without the window by those with it, (3, 3).

    w^2 = size^2 - 2 zeta size/tau + 1/tau^2.
    """
    by_size, by_zeta = (size - mode.damping_ratio / tau) / w, -size / tau / w
    k = 2 * mode.stiffness * w / size**2
    of_zeta = [mode.damping_ratio / w - decay / w**2 * by_size, size / w - decay / w**2 * by_zeta, 0]
    of_stiffness = [k * (by_size - w / size), k * by_zeta, (w / size) ** 2]
    slope = np.array([[by_size, by_zeta, 0], of_zeta, of_stiffness])
    hertz = np.diag([2 * np.pi, 1, 1])
    return np.asarray(np.linalg.inv(hertz) @ slope @ hertz)


MIN_MODES_FOR_COMMON_DECAY, MIN_COMMON_DECAY_SPAN = 4, 3.0
"""Fewest modes with a common decay rate, and least ratio of their highest frequency to the lowest."""
MAX_DECAY_RATE_SPREAD = 0.2
"""Largest standard deviation of the logarithms of common decay rates; chosen.

Over a span of 3, equal damping ratios have 0.4 or more.
"""


def common_decay_rate(modes: Sequence[Mode]) -> float | None:
    """Return the decay rate that all modes share, a sign of an exponential window.

    Structures damp their modes by about equal damping ratios, so that decay rates grow with frequency. Under a window
    exp(-t/tau) that is shorter than their decay all rates are 1/tau, and damping ratios fall as 1/f.

    Parameters
    ----------
    modes : sequence of Mode
        Modes of one FRF.

    Returns
    -------
    float or None
        Decay rate zeta w (1/s); None if the rates differ or the modes are too few.

    Examples
    --------
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
"""Phase scatter of the modes of a lightly damped structure (degrees)."""
MIN_DELAY_PHASE_DEG = 5.0
"""Least phase of a delay at the highest mode (degrees)."""
MIN_MODES_FOR_COMMON_DELAY = 3
"""Fewest modes that a delay is estimated from."""
MAX_DELAY_CHI_SQUARE = 4.0
"""Largest chi-square with the delay, per number of modes less one."""
MAX_DELAY_RESIDUAL_SHARE = 0.1
"""Largest chi-square with the delay over that without it."""


@dataclass(frozen=True)
class CommonDelay:
    """Delay that explains the phases of all modes."""

    skew: float
    """Time by which the response is sampled later than the force (s); the value for `Channel.skew`."""
    skew_std: float
    """Standard error (s)."""

    def phase_deg(self, frequency: float) -> float:
        """Return the phase of a real mode at this frequency (degrees).

        Parameters
        ----------
        frequency : float
            Frequency (Hz).
        """
        return 360 * frequency * self.skew


def common_delay(modes: Sequence[Mode]) -> CommonDelay | None:
    """Estimate the delay between the channels that explains the phases of all modes.

    A response that is sampled later than the force leads by 2 pi f skew on every line; complex modes follow no such
    line.

    Parameters
    ----------
    modes : sequence of Mode
        Modes of one FRF, at least three.

    Returns
    -------
    CommonDelay or None
        Delay; None if the phases are not linear in frequency.

    Examples
    --------
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
"""Half-power half-widths from a mode at which its neighbours are less hidden than on its peak."""


@dataclass(frozen=True)
class MassLoading:
    """Relative changes of a mode by an added mass, to first order."""

    frequency: float
    """Change of the natural frequency (-), < 0."""
    stiffness: float
    """Change of the modal stiffness (-)."""


def mass_loading(mode: Mode, frf: Frf, mass: float) -> MassLoading:
    """Estimate the change of a mode by a small mass at the driving point.

    With the modal mass M = K/w^2 the frequency falls by mass/(2 M). K follows the shape, which the mass bends towards
    the other modes: -2 mass w^2 R of itself, R the receptance at w of all others, those outside the lines, too.

    Parameters
    ----------
    mode : Mode
        Mode of the driving point.
    frf : Frf
        FRF of the driving point.
    mass : float
        Added mass (kg).

    Returns
    -------
    MassLoading
        Relative changes.

    References
    ----------
    First-order perturbation of K phi = w^2 M phi by mass e e^T, e.g. Ewins, Modal Testing, ch. 2.

    Examples
    --------
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
    """Add the uncertainty of a subtracted sensor mass to the errors of a mode.

    Parameters
    ----------
    mode : Mode
        Mode without the sensor mass.
    frf : Frf
        FRF of the driving point.
    mass_std : float
        Standard error of the mass (kg).

    Returns
    -------
    Mode
        Mode with wider covariances.

    Examples
    --------
    >>> mode = Mode(500.0, 0.02, 2e7, covariance=np.diag([0.1, 0.001, 1e5]) ** 2)
    >>> wider = with_mass_uncertainty(mode, synthesize_frf([mode], np.arange(1.0, 1501.0)), mass_std=2e-3)
    >>> round(float(mode.fit_error[0]), 3), round(float(wider.fit_error[0]), 3)  # Hz: 2 g are 0.25 Hz
    (0.1, 0.266)
    """
    loading = mass_loading(mode, frf, mass_std)
    off = loading.frequency * mode.frequency, loading.frequency * mode.damping_ratio, loading.stiffness * mode.stiffness
    return change_covariances(mode, lambda covariance: covariance + np.outer(off, off))
