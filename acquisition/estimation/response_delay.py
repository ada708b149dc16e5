"""Remove a delay of the response from FRFs and hits."""

from dataclasses import replace

import numpy as np

from acquisition.frf import Frf
from acquisition.hit import Hit


def remove_frf_delay(frf: Frf, delay: float) -> Frf:
    """Remove the delay of the response from an FRF.

    Parameters
    ----------
    frf
        FRF of a response that is late.
    delay
        Delay (s), < 0 if the response is early.

    Returns
    -------
    Frf
        FRF with the phase advanced by 2 pi f delay.

    Examples
    --------
    >>> late = Frf(np.array([100.0, 200.0]), np.exp(-2j * np.pi * np.array([100.0, 200.0]) * 1e-3))
    >>> remove_frf_delay(late, 1e-3).receptance.round(9).real.tolist()
    [1.0, 1.0]
    """
    return replace(frf, receptance=frf.receptance * np.exp(2j * np.pi * frf.frequency * delay))


def remove_hit_delay(hit: Hit, delay: float) -> Hit:
    """Remove the delay of the response from a hit, as `remove_frf_delay` does with its FRF.

    Samples that leave the record at its start come back at its end.

    Parameters
    ----------
    hit
        Hit whose response is late.
    delay
        Delay (s), < 0 if the response is early.

    Returns
    -------
    Hit
        Hit without codes.

    Examples
    --------
    >>> late = Hit(np.zeros(64), np.sin(2 * np.pi * (np.arange(64) - 8) / 64), 64.0)  # a period of 1 s, 1/8 s late
    >>> on_time = remove_hit_delay(late, 1 / 8).acceleration
    >>> float(abs(on_time - np.sin(2 * np.pi * np.arange(64) / 64)).max()) < 1e-12
    True
    """
    n = hit.acceleration.size
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(n, 1 / hit.sample_rate) * delay)
    return replace(hit, acceleration=np.fft.irfft(np.fft.rfft(hit.acceleration) * turn, n), codes=None)
