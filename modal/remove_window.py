"""What an exponential window adds to the damping is taken off again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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
    ten thousand, unless `windowed_receptance` has divided by the s^2 that belongs to it.

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
    slope = np.diag([1, 1, left]) @ _slope(mode, time_constant, size, decay, w)
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


def with_windowed_noise(mode: Mode, time_constant: float, record: float) -> Mode:
    """The mode with its covariance from the fit widened by what a window over a record (s) does to white noise.

    Under the window the noise of neighbouring lines is alike: of the values of a record of length T as many are
    independent as the share (integral of w^2)^2 / (T integral of w^4) says, 1 for no window and time_constant/T for a
    short one. A fit takes them all for independent. What the scatter of the hits says holds anyhow.

    Source: Harris (1978), On the use of windows for harmonic analysis, Proc. IEEE 66, 51 (noise bandwidth).

    >>> mode = Mode(500.0, 0.02, 2e7, covariance=np.diag([0.1, 0.001, 1e5]) ** 2)
    >>> widened = with_windowed_noise(mode, time_constant=0.05, record=0.8)  # s
    >>> (widened.fit_error / mode.fit_error).round(2).tolist()  # sqrt(record / time constant) = 4
    [4.0, 4.0, 4.0]
    """
    if mode.covariance is None:
        return mode
    factor = _widening(record / time_constant)
    of_phase = mode.phase_deg_std * (np.sqrt(factor) if mode.jackknife is None else 1.0)
    covariance, freedom = mode.covariance * factor, mode.freedom / factor
    return replace(mode, covariance=covariance, freedom=freedom, phase_deg_std=float(of_phase))


def _widening(a: float) -> float:
    """T (integral of w^4) / (integral of w^2)^2 of w = exp(-a t/T) from 0 to T."""
    return float(a * np.expm1(-4 * a) / -(np.expm1(-2 * a) ** 2))


def _phase_correlation(mode: Mode, slope: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Of the error of the phase, which stays as it is, with those of the values without the window."""
    if mode.phase_correlation is None or mode.best_covariance is None:
        return mode.phase_correlation
    error = np.sqrt(np.diag(slope @ mode.best_covariance @ slope.T))
    return ratio_or_zero(slope @ (mode.phase_correlation * mode.standard_error), error)


def _slope(mode: Mode, tau: float, size: float, decay: float, w: float) -> NDArray[np.float64]:
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
