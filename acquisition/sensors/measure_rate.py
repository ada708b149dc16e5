"""The sample rate of a device, measured against the clock of this computer."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DeviceError
from acquisition.remark import Remark
from acquisition.source import Source

TOLERANCE = 0.002
"""Share by which the measured rate may differ from the nominal one."""
SURE_STD = TOLERANCE / 4
"""Standard error of the rate, as a share of it, up to which it is sure ..."""
LARGEST_STD = TOLERANCE
"""... and above which nothing can be said."""
FEWEST_BLOCKS = 10
"""Arrivals needed for a slope and its error."""
LATENCY = 1e-3
"""A USB host asks its devices once a millisecond: neither end of the time is known better (s)."""
BINS = 20
"""Stretches of the stream; of each only the least delayed block counts."""


@dataclass(frozen=True)
class MeasuredRate:
    """The rate of a stream of scans.

    >>> MeasuredRate(rate=25600.2, std=0.5, n_scans=128000, seconds=5.0).is_sure
    True
    """

    rate: float
    """Scans a second (Hz)."""
    std: float
    """Standard error of the rate (Hz)."""
    n_scans: int
    """Scans between the first and the last block."""
    seconds: float
    """Time between them (s)."""

    @property
    def is_sure(self) -> bool:
        """Whether it is known to 0.05 %."""
        return self.std <= SURE_STD * self.rate


def measure_rate(source: Source, seconds: float = 5.0, clock: Callable[[], float] = time.monotonic) -> MeasuredRate:
    """Start a source, count its scans against the clock (s) for so many seconds, and stop it.

    A block can arrive late, never early. The stream is cut into 20 stretches; of each the block with the least delay
    is kept, stretches that are late as a whole (a busy computer) are left out, and time is regressed on the scan count.
    The standard error is that of the slope, enlarged where neighbouring residuals are alike (lag-1 correlation), and
    joined with that of two ends each known to 1 ms (rectangular: 1 ms / sqrt(6) over the whole time).

    Raises ValueError for seconds that are not > 0, DeviceError where fewer than 10 blocks arrive or the stream ends
    before, and what the source raises.

    >>> fast = SimulatedSource(lambda first, n: np.zeros((1, n)), (Channel("force", 2.25e-3, 5.0),), 10240.0, 10**6)
    >>> ticks = iter(np.arange(10**6) * 0.05)  # s: a clock by which a block of 512 scans comes every 50 ms
    >>> round(measure_rate(fast, seconds=5.0, clock=lambda: next(ticks)).rate)  # Hz
    10240
    """
    if not (np.isfinite(seconds) and seconds > 0):
        raise ValueError(f"seconds={seconds} is not > 0; the rate of a device takes about 5 s")
    arrived: list[float] = []
    scans: list[int] = []
    source.start()
    for block in source.blocks():
        arrived.append(clock())
        scans.append(block.first_scan + block.codes.shape[1])
        if arrived[-1] - arrived[0] >= seconds:
            break
    source.stop()
    elapsed, n_scans = (arrived[-1] - arrived[0], scans[-1] - scans[0]) if scans else (0.0, 0)
    if len(scans) < FEWEST_BLOCKS or elapsed < seconds:
        raise DeviceError(
            f"the DAQ sent {len(scans)} blocks of samples in {elapsed:.2g} s",
            f"to measure its rate, at least {FEWEST_BLOCKS} over {seconds:g} s are needed: check its sample rate "
            "and the cable",
        )
    period, scatter = _slope(np.array(scans, dtype=np.float64), np.array(arrived))
    std = float(np.hypot(scatter, LATENCY / np.sqrt(6) / n_scans) / period**2)
    return MeasuredRate(float(1 / period), std, n_scans, float(elapsed))


def check_rate(measured: MeasuredRate, nominal: float) -> None:
    """DeviceError where the measured rate differs by more than 0.2 % from the nominal one (Hz); where it is not sure,
    by two standard errors more. DeviceError, too, where the standard error exceeds 0.2 %.

    >>> check_rate(MeasuredRate(25600.2, 0.5, 128000, 5.0), nominal=25600.0)
    >>> check_rate(MeasuredRate(24000.0, 0.5, 120000, 5.0), nominal=25600.0)
    Traceback (most recent call last):
        ...
    acquisition.errors.DeviceError: the DAQ delivers 24000.00 ± 0.50 scans a second, not 25600: every ...
    """
    if measured.std > LARGEST_STD * measured.rate:
        raise DeviceError(
            f"the DAQ's rate cannot be measured: its samples arrive too unevenly ({measured.rate:.6g} Hz "
            f"± {measured.std / measured.rate:.2%}, needed ± {LARGEST_STD:.2%})",
            "close other programs and try again",
        )
    off = nominal / measured.rate - 1
    if abs(measured.rate / nominal - 1) > TOLERANCE + (0 if measured.is_sure else 2 * measured.std / nominal):
        raise DeviceError(
            f"the DAQ delivers {measured.rate:.2f} ± {measured.std:.2f} scans a second, not {nominal:g}: every "
            f"frequency would be {abs(off):.1%} too {'high' if off > 0 else 'low'}",
            "correct the DAQ's sample rate or work with the measured one",
        )


def rate_doubt(measured: MeasuredRate) -> Remark | None:
    """Remark on a rate that is not sure; None where it is."""
    if measured.is_sure:
        return None
    share = measured.std / measured.rate
    text = f"the DAQ's sample rate is known to ±{share:.2%} only, and with it every frequency: this computer is busy"
    return Remark("rate-not-sure", "", text, "close other programs and run lobewatch sensors, which measures it again")


def _slope(scans: NDArray[np.float64], arrived: NDArray[np.float64]) -> tuple[float, float]:
    """Seconds a scan and standard error, from the least delayed block of each stretch."""
    period = (arrived[-1] - arrived[0]) / (scans[-1] - scans[0])
    std = 0.0
    stretches = np.array_split(np.arange(scans.size), min(BINS, scans.size))
    for _ in range(4):  # which block is the least delayed depends on the period
        delay = arrived - arrived[0] - period * (scans - scans[0])
        best = np.array([stretch[np.argmin(delay[stretch])] for stretch in stretches])
        correction, std = _robust_slope(scans[best], delay[best])
        period += correction
    return period, std


def _robust_slope(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Least-squares slope and standard error without the points that lie far above the others."""
    rough = y - _median_slope(x, y) * x
    above = rough - np.median(rough)
    spread = 1.4826 * np.median(np.abs(above))
    keep = above <= 4 * spread + 1e-9
    x, y = x[keep] - np.mean(x[keep]), y[keep] - np.mean(y[keep])
    slope = float(x @ y / (x @ x))
    residual = y - slope * x
    energy = float(residual @ residual)
    alike = float(np.clip(residual[1:] @ residual[:-1] / energy, 0.0, 0.9)) if energy > 0 else 0.0
    variance = energy / (x.size - 2) / float(x @ x) * (1 + alike) / (1 - alike)
    return slope, float(np.sqrt(variance))


def _median_slope(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Median of the slopes of all pairs of points (Theil and Sen); x rises."""
    first, second = np.triu_indices(x.size, 1)
    return float(np.median((y[second] - y[first]) / (x[second] - x[first])))
