"""Apply and correct exponential windows, and remove the mass of the sensor."""

from dataclasses import replace

import numpy as np

from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hits.pulse import Pulse, count_pre_hit_samples, extract_baseline, find_pulse


def apply_exponential_window(hit: Hit, time_constant: float) -> Hit:
    """Multiply force and response, without their offsets, by exp(-t/time_constant) from the hit on.

    With both windowed the FRF is that of the structure at a shifted frequency, H(s + 1/time_constant), exactly and for
    any length of the pulse: exp(-at) (h * f) = (exp(-at) h) * (exp(-at) f).

    Parameters
    ----------
    hit
        Hit with a pulse.
    time_constant
        Time constant of the window (s), > 0.

    Returns
    -------
    Hit
        Windowed hit without codes.

    Raises
    ------
    ValueError
        For a hit without a pulse, and for a time constant that is not > 0.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N
    >>> windowed = apply_exponential_window(Hit(force, np.ones(1000), 10000.0, pre_trigger=100), time_constant=0.02)
    >>> round(find_hit_time(windowed) * 1e3, 2), round(measure_time_after_hit(windowed) * 1e3, 2)  # ms
    (10.45, 89.55)
    """
    if not time_constant > 0:
        raise ValueError(f"time_constant={time_constant} s is not > 0")
    pulse = _require_pulse(hit)
    after = np.maximum(np.arange(hit.force.size) - pulse.start, 0) / hit.sample_rate
    window = np.exp(-after / time_constant)
    still = hit.acceleration - np.mean(extract_baseline(hit.acceleration, count_pre_hit_samples(hit)))
    return replace(hit, force=pulse.force * window, acceleration=still * window, codes=None)


def correct_windowed_receptance(frf: Frf, time_constant: float) -> Frf:
    """Correct the receptance of an FRF whose responses were recorded under an exponential window.

    Acceleration under the window is receptance times s^2 at s = 2 pi i f + 1/time_constant, velocity is receptance
    times s.

    Parameters
    ----------
    frf
        FRF as it was measured; one measured as receptance is right as it is.
    time_constant
        Time constant of the window (s).

    Returns
    -------
    Frf
        FRF with the corrected receptance.

    Examples
    --------
    >>> line, tau = np.array([100.0, 200.0]), 0.05
    >>> seen = from_accelerance(line, (2j * np.pi * line + 1 / tau) ** 2 * 1e-8)  # 0.01 um/N under a window
    >>> round(float(correct_windowed_receptance(seen, tau).receptance[0].real) * 1e6, 6)  # um/N
    0.01
    """
    if frf.measured_as == "receptance":
        return frf
    s = 2j * np.pi * frf.frequency
    share = s / (s + 1 / time_constant)
    return replace(frf, receptance=frf.receptance * (share if frf.measured_as == "mobility" else share**2))


def find_hit_time(hit: Hit) -> float:
    """Find the time of the hit, the centre of its pulse.

    Parameters
    ----------
    hit
        Hit with a pulse.

    Returns
    -------
    float
        Time from the start of the record (s).

    Raises
    ------
    ValueError
        For a hit without a pulse.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N, samples at 10.0 to 10.9 ms
    >>> hit = Hit(force, np.zeros(1000), 10000.0, pre_trigger=100)
    >>> round(find_hit_time(hit) * 1e3, 2)  # ms
    10.45
    """
    pulse = _require_pulse(hit)
    part = slice(max(pulse.start, 0), pulse.end)
    return float(np.average(np.arange(hit.force.size)[part], weights=pulse.force[part])) / hit.sample_rate


def measure_time_after_hit(hit: Hit) -> float:
    """Measure the length of the record after the hit.

    Parameters
    ----------
    hit
        Hit with a pulse.

    Returns
    -------
    float
        Time from the hit to the end of the record (s).

    Raises
    ------
    ValueError
        For a hit without a pulse.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N, at 10 ms of a record of 100 ms
    >>> hit = Hit(force, np.zeros(1000), 10000.0, pre_trigger=100)
    >>> round(measure_time_after_hit(hit) * 1e3, 2)  # ms
    89.55
    """
    return hit.force.size / hit.sample_rate - find_hit_time(hit)


def _require_pulse(hit: Hit) -> Pulse:
    pulse = find_pulse(hit)
    if pulse is None:
        raise ValueError("a hit has no force pulse; check hits with check_hit first")
    return pulse


def remove_sensor_mass(frf: Frf, mass: float) -> Frf:
    """Remove the mass of the sensor from the FRF of a driving point.

    The structure feels the hammer's force and -mass x acceleration of the sensor, so that 1/H = 1/H_m + mass w^2 with
    the measured receptance H_m. This does not hold where the response is not at the hammer's point.

    Parameters
    ----------
    frf
        Measured FRF.
    mass
        Mass that moves with the driving point (kg).

    Returns
    -------
    Frf
        FRF without the mass; the same for 0 kg.

    References
    ----------
    Ashory (1998), Correction of mass-loading effects of transducers, IMAC 16.

    Examples
    --------
    A sensor of 20 g on a mass of 2 kg:

    >>> measured = from_accelerance([100.0, 200.0], [1 / 2.02, 1 / 2.02])
    >>> round(float(1 / remove_sensor_mass(measured, 0.02).accelerance[0].real), 6)  # kg
    2.0
    """
    if mass == 0:
        return frf
    loading = 1 + mass * (2 * np.pi * frf.frequency) ** 2 * frf.receptance
    return replace(frf, receptance=frf.receptance / loading, mass_removed=frf.mass_removed + mass)
