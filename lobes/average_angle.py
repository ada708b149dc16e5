"""Stability lobes by the average tooth angle."""

from __future__ import annotations

from numpy.typing import ArrayLike

from lobes.cut import Cut
from lobes.loop_limits import loop_limits
from lobes.speeds import check_speeds
from lobes.stability_lobes import StabilityLobes
from lobes.tip_response import Tip, tip_responses, weighted_sum


def average_angle(x: Tip | None, y: Tip | None, cut: Cut, speed_rpm: ArrayLike) -> StabilityLobes:
    """Limiting depth at each speed (rpm) for the tooth frozen at its average angle.

    x is the feed, y the normal to it; None stands for a direction that is rigid or not known. With
    G_or = mu_x Gx + mu_y Gy (`Cut.orientation_factors`) the cut is at its limit where chatter at frequency f_c > 0
    sustains itself,

        Ks Nt* b G_or (1 - exp(-2 pi i f_c / f_t)) = -1,     tooth frequency f_t = N speed / 60:

    b = -1 / (2 Ks Nt* Re G_or) where Re G_or < 0, and f_c / f_t = j + eps / (2 pi), j = 0, 1, 2 ...,
    eps / 2 = atan2(-Re G_or, Im G_or). The limit is the lowest b over all lobes j; `crossings` holds it alone.
    A mean force knows no flip lobes: at low immersion (below 0.25) the true limit can be lower.

    From FRFs only chatter inside their common usable band is seen: cut them with `Frf.in_band` to what is to be
    trusted; x and y may have different lines (see `lobes.tip_response`). A depth of inf means no chatter there.

    Raises ValueError for speeds not > 0, two rigid directions, an empty list of modes, modes of negative stiffness,
    and FRFs without a common band.
    Source: Tlusty; Schmitz & Smith, Machining Dynamics, ch. 4.

    Of one mode in the feed the limit at the worst speed is 2 K zeta (1 + zeta) / (Ks mu_x Nt*):

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> half = Cut(teeth=2, immersion=0.5, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = average_angle([mode], None, half, np.linspace(4000.0, 16000.0, 4001))
    >>> round(float(lobes.depth.min()) * 1e3, 3)  # mm
    3.627
    >>> factor = half.specific_force * half.orientation_factors[0] * half.teeth_in_cut
    >>> round(2 * 2e7 * 0.02 * (1 + 0.02) / factor * 1e3, 3)
    3.627
    """
    speed = check_speeds(speed_rpm)
    tips = tip_responses(x, y, cut.teeth * float(speed.max()) / 60)
    force = cut.specific_force * cut.teeth_in_cut
    loop = weighted_sum([(force * cut.orientation_factors[axis], tip) for axis, tip in tips])
    return loop_limits([loop], cut, speed, "average angle")
