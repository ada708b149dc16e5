"""The verdict on one hit in flags alone."""

from __future__ import annotations

from acquisition.hit import Hit, HitFlags
from acquisition.verdicts.judge_hit import judge_hit


def check_hit(hit: Hit) -> HitFlags:
    """All that is wrong with a hit, from its time signals alone; falsy when it may be averaged. See `judge_hit`.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> again = 80 * np.roll(pulse, 60)  # N, 6 ms later
    >>> [check_hit(Hit(force, response, 10240.0, 100)).words for force in (200 * pulse, 200 * pulse + again)]
    ['good', 'double hit']
    """
    return judge_hit(hit).flags
