"""Simulate milling in the time domain, many cuts at once.

    chip     h = feed sin(phi) + n . q + r - u,  n = (sin phi, cos phi), r run-out of the tooth
    surface  u <- u - feed sin(phi) + max(h, 0): the furthest material that all earlier teeth have left at this angle
    force    F = -b (Kt (cos, -sin) + Kr (sin, cos)) max(h, 0) - b (Kte (cos, -sin) + Kre (sin, cos))

q is the displacement of the tip along the feed and its normal. A tooth that leaves the cut and comes back meets the
surface left one, two or more tooth periods ago. Between steps the modes vibrate freely, which is exact. The force of a
step acts as one impulse at its center: second order, no numerical damping, in the frequency domain a residual
flexibility of -(w dt)^2 / 12 K. The depth ramps as a factor of the force. Edges push wherever they are in the arc of
cut: a force that ended with the chip would push the tooth out of a thin one and move the stability limit.

With uneven tooth pitch one cut is stepped at a time. A turn has a whole number of steps, and each pitch nearly so. The
surface is stored by its angle, not by its time.

Source: Schmitz & Smith, Machining Dynamics, ch. 4.4 (time-domain simulation with run-out and loss of contact).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Complexes, Floats
from acquisition.emulation import milling_cut
from acquisition.emulation.milling_cut import MillingCut, ModeTables, Passage, ToothTables

MAX_STEP_COUNT_FACTOR = 1.25
"""Factor by which steps per turn may exceed those needed, to make pitches whole numbers of steps."""
MAX_TOOTH_PERIOD_RATIO = 1.25
"""Largest ratio of tooth periods in a group of cuts that are stepped together."""
MAX_CUTS_PER_GROUP = 48
"""Most cuts that are stepped together."""


class TipMotion(NamedTuple):
    """Motion of a tool tip in a passage through a part."""

    sample_rate: float
    """Step rate (Hz)."""
    acceleration: Floats
    """Acceleration along x and y of the machine (m/s^2), shape (2, n)."""


def simulate_cut(cut: MillingCut, passage: Passage | None = None) -> TipMotion:
    """Simulate one cut.

    Parameters
    ----------
    cut
        Cut and machine.
    passage
        Times in air and in the cut, None for the defaults.

    Returns
    -------
    TipMotion
        Motion of the tool tip.
    """
    return next(simulate_cuts([cut], passage))[1]


def simulate_cuts(cuts: Sequence[MillingCut], passage: Passage | None = None) -> Iterator[tuple[int, TipMotion]]:
    """Simulate many cuts, similar ones together.

    Parameters
    ----------
    cuts
        Cuts and their machines.
    passage
        Times in air and in the cut, None for the defaults.

    Yields
    ------
    index : int
        Index of the cut. Cuts come in the order in which they are ready.
    motion : TipMotion
        Motion of the tool tip.
    """
    passage = passage or Passage()
    for number, cut in enumerate(cuts):
        if cut.pitch:
            yield number, _simulate_uneven_cut(cut, passage)
    for group in _group_cuts(cuts):
        members = [cuts[i] for i in group]
        modes, teeth = milling_cut.build_tables(members, max(map(milling_cut.count_steps_needed, members)))
        cutting, swing = _simulate_group(members, modes, teeth, passage)
        for place, number in enumerate(group):
            yield number, _assemble_motion(cutting[:, place], swing[place], modes, place, passage)


def _simulate_uneven_cut(cut: MillingCut, passage: Passage) -> TipMotion:
    """Simulate a cut with uneven pitch, with steps that make its pitches nearly whole numbers of steps."""
    needed = milling_cut.count_steps_needed(cut) * cut.teeth
    counts = np.arange(needed, math.ceil(MAX_STEP_COUNT_FACTOR * needed) + 1)
    steps = counts[:, np.newaxis] * np.array(cut.pitch) / (2 * np.pi)
    off = np.max(np.abs(steps - np.rint(steps)), axis=1) / counts
    single = replace(cut, teeth=1, pitch=(), runout=())
    modes, tooth = milling_cut.build_tables([single], int(counts[np.argmin(np.round(off, 9))]))
    cells, step = len(tooth.root), float(modes.step[0])
    behind = np.rint(np.cumsum((0.0, *cut.pitch[1:])) * cells / (2 * np.pi)).astype(np.int64)
    share = np.array(cut.pitch) * cut.teeth / (2 * np.pi)
    stands_out = np.array(cut.runout or np.zeros(cut.teeth))
    tables = tooth.rigid_chip, tooth.root, tooth.reach, tooth.chip_gain, tooth.edge_gain
    thick, root, reach, push, rub = (table[:, 0] for table in tables)
    number = math.ceil(passage.cutting / step)
    depth = passage.depth_at(np.asarray((np.arange(number) + 0.5) * step))
    surface, swing = np.zeros_like(thick), np.zeros(modes.flight.shape[1], dtype=complex)
    swings, gains = np.empty((number, swing.size), dtype=complex), np.empty((number, swing.size))
    for n in range(number):
        at = (n - behind) % cells
        swing = swing * modes.flight[0]
        feed = thick[at] * share[:, np.newaxis]
        chip = feed + root[at] * stands_out[:, np.newaxis] + reach[at] @ swing.imag - surface[at]
        np.maximum(chip, 0.0, out=chip)
        surface[at] += chip - feed
        gains[n] = depth[n] * (np.einsum("jme,je->m", push[at], chip) + np.sum(rub[at], axis=0))
        swing = swing + gains[n]
        swings[n] = swing
    cutting = _tip_acceleration(swings[:, np.newaxis], gains[:, np.newaxis], modes)[:, 0].astype(np.float32)
    return _assemble_motion(cutting, swing, modes, 0, passage)


def _group_cuts(cuts: Sequence[MillingCut]) -> Iterator[list[int]]:
    """Yield the indices of cuts to step together, all with evenly spaced teeth."""
    group: list[int] = []
    for i in sorted((i for i, cut in enumerate(cuts) if not cut.pitch), key=lambda i: cuts[i].tooth_period):
        longest = MAX_TOOTH_PERIOD_RATIO * cuts[group[0]].tooth_period if group else math.inf
        if len(group) == MAX_CUTS_PER_GROUP or cuts[i].tooth_period > longest:
            yield group
            group = []
        group.append(i)
    if group:
        yield group


def _simulate_group(
    cuts: Sequence[MillingCut], modes: ModeTables, teeth: ToothTables, passage: Passage
) -> tuple[NDArray[np.float32], Complexes]:
    """Return acceleration from first to last contact (n, c, 2) in m/s^2, and the mode states then (c, m)."""
    steps, step = len(teeth.root), modes.step
    periods = math.ceil(passage.cutting / (steps * float(np.min(step))))
    number = np.array([cut.teeth for cut in cuts])[:, np.newaxis]
    runout = np.zeros((len(cuts), int(np.max(number))))
    for row, cut in zip(runout, cuts, strict=True):
        row[: len(cut.runout)] = cut.runout
    surface, swing = np.zeros_like(teeth.rigid_chip), np.zeros(modes.flight.shape, dtype=complex)
    record = np.empty((periods * steps, len(cuts), 2), dtype=np.float32)
    for period in range(periods):
        stands_out = np.take_along_axis(runout[np.newaxis], (teeth.pitch_index - period) % number, axis=2)
        time = (period * steps + np.arange(steps)[:, np.newaxis] + 0.5) * step
        depth = passage.depth_at(time)
        push, rub = teeth.chip_gain, teeth.edge_gain * depth[..., np.newaxis]
        if np.any(depth < 1):
            push = push * depth[..., np.newaxis, np.newaxis]
        clearance = teeth.rigid_chip + teeth.root * stands_out - surface
        swings, gains, chips = _step_tooth_period(swing, modes.flight, teeth.reach, push, rub, clearance)
        surface += chips - teeth.rigid_chip
        swing = swings[-1]
        record[period * steps : (period + 1) * steps] = _tip_acceleration(swings, gains, modes)
    return record, swing


def _step_tooth_period(
    swing: Complexes, flight: Complexes, reach: Floats, push: Floats, rub: Floats, clearance: Floats
) -> tuple[Complexes, Floats, Floats]:
    """Step one tooth period: mode states after each step, their gains in it (s, c, m), and chips (s, c, e)."""
    swings = np.empty((len(clearance), *swing.shape), dtype=complex)
    gains, chips = np.empty(swings.shape), np.empty(clearance.shape)
    columns = (swings.imag[..., np.newaxis], gains[..., np.newaxis], chips[..., np.newaxis])
    rows = zip(swings, swings.real, gains, chips, clearance, reach, push, rub, *columns, strict=True)
    for now, speed, gain, chip, remaining, to, by, edge, place, gained, cut in rows:
        np.multiply(swing, flight, out=now)
        np.matmul(to, place, out=cut)
        np.add(chip, remaining, out=chip)
        np.maximum(chip, 0.0, out=chip)
        np.matmul(by, cut, out=gained)
        np.add(gain, edge, out=gain)
        np.add(speed, gain, out=speed)
        swing = now
    return swings, gains, chips


def _tip_acceleration(swings: Complexes, gains: Floats, modes: ModeTables) -> Floats:
    """Return q'' = w^2 F / K - 2 zeta w q' - w^2 q along x and y (s, c, 2), at the impulse of each step."""
    free = np.imag(modes.pole**2 * (swings - gains / 2))
    of_modes = free + gains * modes.pole.imag / modes.step[:, np.newaxis]
    return np.asarray(np.einsum("cam,scm->sca", modes.axis, of_modes))


def _assemble_motion(
    cutting: NDArray[np.float32], swing: Complexes, modes: ModeTables, place: int, passage: Passage
) -> TipMotion:
    """Put one cut between rest and free decay."""
    step, pole, axis = float(modes.step[place]), modes.pole[place], modes.axis[place]
    n = round((passage.cutting + passage.after) / step)
    remaining = step * np.arange(1, n - len(cutting) + 1)
    ringing = axis @ np.imag((pole**2 * swing)[:, np.newaxis] * np.exp(np.outer(pole, remaining)))
    still = np.zeros((2, round(passage.before / step)))
    return TipMotion(1 / step, np.hstack([still, cutting[:n].T, ringing]))
