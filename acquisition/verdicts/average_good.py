"""The mean of recorded hits, without those that are no good."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.errors import DataError
from acquisition.estimation.estimate_frf import estimate_frf
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.verdicts.judge_hit import judge_hit


def average_good(hits: Sequence[Hit]) -> tuple[Frf | None, tuple[HitFlags, ...]]:
    """H1 FRF of the good hits, None without their force, and the verdict on each.

    DataError with the reasons where no hit is good.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> forces = 200 * pulse, 200 * pulse + 80 * np.roll(pulse, 60), 201 * pulse
    >>> frf, flags = average_good([Hit(force, response, 10240.0, 100) for force in forces])
    >>> frf.n_averages, [flag.words for flag in flags]
    (2, ['good', 'double hit', 'good'])
    """
    verdicts = [judge_hit(hit) for hit in hits]
    good = [hit for hit, verdict in zip(hits, verdicts, strict=True) if not verdict.flags]
    if not good:
        reasons = "; ".join(f"hit {i}: {verdict.flags.words}. {verdict.text}" for i, verdict in enumerate(verdicts, 1))
        raise DataError(f"no good hit of {len(hits)}: {reasons}")
    return estimate_frf(good) if good[0].has_force else None, tuple(verdict.flags for verdict in verdicts)
