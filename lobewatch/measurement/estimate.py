"""Value with its standard error."""

from __future__ import annotations

import math
from typing import NamedTuple


class Estimate(NamedTuple):
    """Value with its standard error, in any unit.

    >>> first, now = Estimate(700.0, 0.5), Estimate(665.0, 0.5)  # Hz
    >>> change = now.change_since(first)
    >>> f"{change.value:.2f} +- {change.std:.2f} %"
    '-5.00 +- 0.10 %'
    """

    value: float
    """Value; NaN if unknown."""
    std: float = math.nan
    """Standard error in the same unit; NaN if unknown."""

    @property
    def is_known(self) -> bool:
        """True if there is a value."""
        return math.isfinite(self.value)

    def change_since(self, then: Estimate) -> Estimate:
        """Return the relative change (%) since an earlier value, positive for a rise.

        Parameters
        ----------
        then
            Earlier value, whose standard error is propagated too.
        """
        ratio = self.value / then.value
        error = math.hypot(then.std / then.value, self.std / self.value)
        return Estimate(100 * (ratio - 1), 100 * abs(ratio) * error)


UNKNOWN_ESTIMATE = Estimate(math.nan)
"""Unknown value."""
