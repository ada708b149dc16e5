"""An exponential window over hits that still ring when their record ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hits.pulse import Pulse, baseline, find_pulse, samples_before


def exponential_window(hit: Hit, time_constant: float) -> Hit:
    """Force and response, both without their offsets, times exp(-t/time_constant) (s) from the hit on.

    Over both, because then the FRF is that of the structure at a shifted frequency, H(s + 1/time_constant), exactly and
    however long the pulse is: exp(-at) (h * f) = (exp(-at) h) * (exp(-at) f). Raises ValueError for a hit without a
    pulse, and for a time constant that is not > 0.

    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N
    >>> windowed = exponential_window(Hit(force, np.ones(1000), 10000.0, pre_trigger=100), time_constant=0.02)
    >>> round(time_of_hit(windowed) * 1e3, 2), round(time_after_hit(windowed) * 1e3, 2)  # ms
    (10.45, 89.55)
    """
    if not time_constant > 0:
        raise ValueError(f"time_constant={time_constant} s is not > 0")
    pulse = _pulse(hit)
    after = np.maximum(np.arange(hit.force.size) - pulse.start, 0) / hit.sample_rate
    window = np.exp(-after / time_constant)
    still = hit.acceleration - np.mean(baseline(hit.acceleration, samples_before(hit)))
    return replace(hit, force=pulse.force * window, acceleration=still * window, codes=None)


def windowed_receptance(frf: Frf, time_constant: float) -> Frf:
    """An FRF of responses under an exponential window with the receptance that belongs to them.

    Acceleration under it is receptance times s^2 at s = 2 pi i f + 1/time_constant (s), no longer at 2 pi i f, velocity
    times s. An FRF that was measured as receptance is right as it is.

    >>> line, tau = np.array([100.0, 200.0]), 0.05
    >>> seen = from_accelerance(line, (2j * np.pi * line + 1 / tau) ** 2 * 1e-8)  # 0.01 um/N under a window
    >>> round(float(windowed_receptance(seen, tau).receptance[0].real) * 1e6, 6)  # um/N
    0.01
    """
    if frf.measured_as == "receptance":
        return frf
    s = 2j * np.pi * frf.frequency
    share = s / (s + 1 / time_constant)
    return replace(frf, receptance=frf.receptance * (share if frf.measured_as == "mobility" else share**2))


def time_of_hit(hit: Hit) -> float:
    """When the hammer hits, the centre of its pulse (s from the record's start); ValueError without a pulse.

    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N, samples at 10.0 to 10.9 ms
    >>> hit = Hit(force, np.zeros(1000), 10000.0, pre_trigger=100)
    >>> round(time_of_hit(hit) * 1e3, 2)  # ms
    10.45
    """
    pulse = _pulse(hit)
    part = slice(max(pulse.start, 0), pulse.end)
    return float(np.average(np.arange(hit.force.size)[part], weights=pulse.force[part])) / hit.sample_rate


def time_after_hit(hit: Hit) -> float:
    """What the record holds from the hit on (s); ValueError without a pulse.

    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N, at 10 ms of a record of 100 ms
    >>> hit = Hit(force, np.zeros(1000), 10000.0, pre_trigger=100)
    >>> round(time_after_hit(hit) * 1e3, 2)  # ms
    89.55
    """
    return hit.force.size / hit.sample_rate - time_of_hit(hit)


def _pulse(hit: Hit) -> Pulse:
    pulse = find_pulse(hit)
    if pulse is None:
        raise ValueError("a hit has no force pulse; check hits with check_hit first")
    return pulse
