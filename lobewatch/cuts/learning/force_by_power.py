"""What the power of a cut says of its cutting coefficient, and how sure that is.

All that is chosen here is plausible, not measured, but for cuts that chatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lobes import Cut
from lobewatch.machine.settings.cut_power import CutPower

DRIVE = 0.15
"""Standard deviation, relative, of the power that a drive shows over that of its cuts, the same in all: efficiency of
motor, belt and gears under load, what the display leaves out, edges that do not rub in proportion to Kt."""
EDGE, UNKNOWN_EDGE = 0.3, 0.5
"""Standard deviations, relative, of Kte over Kt where it is known (edges are sharper or duller than those that it was
measured with), and where it is not: what is published differs by three times."""
OWN = 0.05
"""Standard deviation, relative, of one reading: a display that jumps, a feed or a radial depth a little off."""
CHATTERING, CHATTERING_OWN = 0.89, 0.08
"""Power of a cut that chatters over that of a stable one, and how far that scatters from cut to cut, by simulations in
time: edges that have left the cut do not rub, and thick chips, which it has beside thin ones, cost less. See
docs/cuts.md."""


@dataclass(frozen=True)
class ForceByPower:
    """Kt by power; errors as standard deviations of its logarithm."""

    force: float
    """Kt over the one that the cut was taken for."""
    common: float
    """Error that all readings of a material share."""
    own: float
    """Error of this one alone."""


def force_by_power(power: CutPower, cut: Cut, chatters: bool) -> ForceByPower:
    """What a power says of a cut in a material."""
    of_edges = power.edge_share / (1 + power.edge_share)
    common = math.hypot(DRIVE, (EDGE if power.edge_known else UNKNOWN_EDGE) * of_edges)
    middle, scatter = (CHATTERING, CHATTERING_OWN) if chatters else (1.0, 0.0)
    return ForceByPower(power.tangential / cut.tangential / middle, common, math.hypot(OWN, scatter))
