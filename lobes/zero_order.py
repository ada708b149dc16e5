"""Stability lobes by the zero-order approximation and by the average tooth angle."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Remark
from lobes.cut import Cut
from lobes.damped_loop import DampedLoop
from lobes.loop_limits import MEAN_FORCE_REMEDY, frequency_blocks, loop_limits
from lobes.stability_lobes import StabilityLobes, check_speeds
from lobes.tip_response import TipData, TipResponse, common_grid, cross_response, tip_responses, weighted_sum
from lobes.tooth_force import interval_forces, mean_damping, mean_force
from modal.arrays import Complexes, Floats

MIN_NET_FORCE_RATIO = 0.7
"""Least mean force of one direction over the mean of its magnitude for which the zero-order approximation is valid."""
CANCELLATION_SAMPLES = 400
"""Intervals of a tooth period for that mean."""


def zero_order_lobes(
    x: TipData | None, y: TipData | None, cut: Cut, speed_rpm: ArrayLike, cross: TipData | None = None
) -> StabilityLobes:
    """Compute stability lobes by the zero-order approximation (ZOA): the force matrix averaged over a turn.

    With H0 the mean of the force matrix (`lobes.tooth_force`; H0 = -N Kt alpha / (4 pi) of the source) and
    G = [[Gx, Gxy], [Gxy, Gy]] the cut is at its limit if chatter at frequency f_c > 0 sustains itself,

        det(I + b (1 - exp(-2 pi i f_c / f_t)) H0 G(f_c)) = 0,     tooth frequency f_t = N speed / 60:

    b = -1 / (2 Re L) for the eigenvalues L of H0 G with Re L < 0; the lowest b over both and over all lobes counts.
    A mean force has no flip lobes: at low immersion (below 0.25) the true limit can be lower, at half immersion it
    can be 15 % off at a given speed. For process damping see `lobes.damped_loop`; then there are no lobe curves.

    Parameters
    ----------
    x, y : Frf, sequence of Mode, or None
        Tool tip in the feed direction and normal to it; None for a rigid or unknown direction. FRFs show chatter inside
        their common usable band only; each may have its own lines.
    cut : Cut
        Cutter, immersion and material.
    speed_rpm : array_like, shape (n,)
        Spindle speeds (rpm).
    cross : Frf or sequence of Mode, optional
        Cross response, hit in x and measured in y; the stiffness of modes has their sign. Default: x and y are
        uncoupled.

    Returns
    -------
    StabilityLobes
        Limiting depths (m); inf for no chatter.

    Raises
    ------
    ValueError
        As `average_angle_lobes`, and for a cross FRF without both directions.

    References
    ----------
    Altintas & Budak, Analytical prediction of stability lobes in milling, CIRP Annals 44 (1995) 357-362.

    Examples
    --------
    In a slot the eigenvalues of H0 are N (Kr +- i Kt) / 4. If x and y are alike, L follows in closed form:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = zero_order_lobes([mode], [mode], slot, np.linspace(4000.0, 16000.0, 1001))
    >>> lowest = lobes.minimum
    >>> f"{lowest.depth * 1e3:.3f} mm at {lowest.chatter_frequency:.0f} Hz"
    '1.123 mm at 501 Hz'
    >>> L = [2 / 4 * (200e6 + sign * 700e6j) * mode.receptance(np.linspace(400.0, 600.0, 2001)) for sign in (1, -1)]
    >>> f"{-1e3 / (2 * np.real(L).min()):.3f} mm"
    '1.123 mm'
    """
    speed = check_speeds(speed_rpm)
    tips = tip_responses(x, y, cut.teeth * float(speed.max()) / 60)
    force = mean_force(cut)
    if cross is not None and len(tips) == 1:
        raise ValueError("cross is given, but x or y is missing. Give the modes or the FRF of both directions.")
    if len(tips) == 1:
        ((axis, tip),) = tips
        lobes = loop_limits([weighted_sum([(force[axis, axis], tip)])], cut, speed, "zero order")
        lobes = replace(lobes, remarks=(*_cancellation_remarks(cut, axis), *lobes.remarks))
        return _with_process_damping(lobes, cut, {axis: tip})
    responses = [tip for _, tip in tips]
    if cross is not None:
        responses.append(cross_response(cross, float(responses[0].grid[-1])))
    lobes = loop_limits(_loop_eigenvalues(force, *responses), cut, speed, "zero order")
    return _with_process_damping(lobes, cut, dict(enumerate(responses)))


def _with_process_damping(lobes: StabilityLobes, cut: Cut, tips: Mapping[int, TipResponse]) -> StabilityLobes:
    """Return limits with process damping, without lobe curves; tips: receptances xx, yy and xy by their place."""
    if cut.process_damping == 0:
        return lobes

    def receptances(frequency: Floats) -> tuple[Complexes, Complexes, Complexes]:
        rigid = np.zeros(frequency.shape, np.complex128)
        xx, yy, xy = (tips[i].receptance(frequency) if i in tips else rigid for i in range(3))
        return xx, yy, xy

    size = TipResponse(common_grid([*tips.values()]), lambda f: np.sum(np.abs(receptances(f)), axis=0) + 0j)
    force, damping = mean_force(cut)[np.newaxis], mean_damping(cut)[np.newaxis]
    loop = DampedLoop(cut, force, damping, receptances, np.zeros(force.shape))
    teeth = cut.teeth * lobes.speed_rpm / 60
    depth, chatter = np.empty((2, teeth.size))
    for rows, grid in frequency_blocks(size, cut, teeth):
        depth[rows], chatter[rows] = (part[:, 0] for part in loop.limits(grid[np.newaxis], teeth[rows, np.newaxis]))
    kind, crossings = np.where(np.isfinite(depth), "hopf", ""), depth[:, np.newaxis]
    return replace(lobes, depth=depth, chatter_frequency=chatter, kind=kind, crossings=crossings, curves=tuple)


def _cancellation_remarks(cut: Cut, axis: int) -> tuple[Remark, ...]:
    """Return a remark if most of the force in the single known direction cancels over a turn."""
    forces = interval_forces(cut, CANCELLATION_SAMPLES).sum(axis=0)[:, axis, axis]
    share = abs(np.mean(forces)) / np.mean(np.abs(forces))
    if share >= MIN_NET_FORCE_RATIO:
        return ()
    text = (
        f"depth limit may be much too high, because {100 * (1 - share):.0f} % of the force in {'xy'[axis]} "
        "(the only known direction) cancels over a turn"
    )
    return (Remark("force-cancels", "", text, MEAN_FORCE_REMEDY),)


def _loop_eigenvalues(
    force: Floats, x: TipResponse, y: TipResponse, cross: TipResponse | None = None
) -> list[TipResponse]:
    """Return both eigenvalues L = t +- sqrt(t^2 - det) of H0 G, t = trace / 2, each continuous over frequency."""
    grid = common_grid([tip for tip in (x, y, cross) if tip is not None])

    def half_trace_and_root(frequency: Floats) -> tuple[Complexes, Complexes]:
        gx, gy = x.receptance(frequency), y.receptance(frequency)
        half = (force[0, 0] * gx + force[1, 1] * gy) / 2
        determinant = force[0, 0] * force[1, 1] - force[0, 1] * force[1, 0]
        product = determinant * gx * gy
        if cross is not None:
            gxy = cross.receptance(frequency)
            half = half + (force[0, 1] + force[1, 0]) * gxy / 2
            product = product - determinant * gxy**2
        return half, np.sqrt(half**2 - product)

    half_trace, root = half_trace_and_root(grid)
    jumps = np.real(root[1:] * np.conj(root[:-1])) < 0
    root *= np.concatenate(([1.0], np.cumprod(np.where(jumps, -1.0, 1.0))))

    def branch(side: float) -> TipResponse:
        def value(frequency: Floats) -> Complexes:
            half, root_here = half_trace_and_root(frequency)
            near = root[np.clip(np.searchsorted(grid, frequency), 0, grid.size - 1)]
            return np.asarray(half + side * np.where(np.real(root_here * np.conj(near)) < 0, -root_here, root_here))

        return TipResponse(grid, value, half_trace + side * root)

    return [branch(1.0), branch(-1.0)]


def average_angle_lobes(x: TipData | None, y: TipData | None, cut: Cut, speed_rpm: ArrayLike) -> StabilityLobes:
    """Compute stability lobes by the average tooth angle (Tlusty).

    With G_or = mu_x Gx + mu_y Gy (`Cut.orientation_factors`) the cut is at its limit if chatter at frequency f_c > 0
    sustains itself,

        Ks Nt* b G_or (1 - exp(-2 pi i f_c / f_t)) = -1,     tooth frequency f_t = N speed / 60:

    b = -1 / (2 Ks Nt* Re G_or) for Re G_or < 0, and f_c / f_t = j + eps / (2 pi), j = 0, 1, 2 ...,
    eps / 2 = atan2(-Re G_or, Im G_or). The limit is the lowest b over all lobes j; `crossings` holds only it.
    A mean force has no flip lobes: at low immersion (below 0.25) the true limit can be lower. Process damping is left
    out.

    Parameters
    ----------
    x, y : Frf, sequence of Mode, or None
        Tool tip in the feed direction and normal to it; None for a rigid or unknown direction. FRFs show chatter inside
        their common usable band only (cut them with `Frf.in_band`); each may have its own lines.
    cut : Cut
        Cutter, immersion and material.
    speed_rpm : array_like, shape (n,)
        Spindle speeds (rpm).

    Returns
    -------
    StabilityLobes
        Limiting depths (m); inf for no chatter.

    Raises
    ------
    ValueError
        For speeds not > 0, two rigid directions, an empty list of modes, modes of negative stiffness,
        and FRFs without a common band.

    References
    ----------
    Tlusty; Schmitz & Smith, Machining Dynamics, ch. 4.

    Examples
    --------
    For one mode in the feed the limit at the worst speed is 2 K zeta (1 + zeta) / (Ks mu_x Nt*):

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> half = Cut(teeth=2, immersion=0.5, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = average_angle_lobes([mode], None, half, np.linspace(4000.0, 16000.0, 4001))
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
