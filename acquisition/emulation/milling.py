"""Milling stepped through time, many cuts at once: what the tool tip does.

    chip     h = feed sin(phi) + n . q + r - u,  n = (sin phi, cos phi), r how far the tooth stands out
    surface  u <- u - feed sin(phi) + max(h, 0): the furthest material that all earlier teeth have left at this angle
    force    F = -b (Kt (cos, -sin) + Kr (sin, cos)) max(h, 0) - b (Kte (cos, -sin) + Kre (sin, cos))

q is the displacement of the tip along the feed and its normal. A tooth that leaves the cut and comes back finds what
was left one, two or more tooth periods ago. Between steps the modes swing freely, which is exact; the force of a step
acts as one impulse in its middle: second order, no damping of its own, in the frequency domain a residual flexibility
of -(w dt)^2 / 12 K. The depth comes and goes as a factor of the force. Edges push wherever they are in the arc of cut:
a force that ended with the chip would push the tooth out of a thin one, and move the limit of stability.

Source: Schmitz & Smith, Machining Dynamics, ch. 4.4 (time-domain simulation with run-out and loss of contact).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.emulation.milling_cut import MillingCut, Passage
from acquisition.emulation.milling_tables import ModeTables, ToothTables, steps_needed, tables
from acquisition.emulation.uneven_milling import turn_tables, uneven_cutting

Floats = NDArray[np.float64]

ALIKE = 1.25
"""Cuts are stepped together whose tooth periods differ by this factor at most ..."""
TOGETHER = 48
"""... and no more than so many."""
TURNS = 8
"""Turns of the spindle that are compared."""


@dataclass(frozen=True, eq=False)
class TipMotion:
    """What a tool tip did in a passage through a part."""

    sample_rate: float
    """Steps a second (Hz)."""
    acceleration: Floats
    """Acceleration along x and y of the machine (m/s^2), shape (2, n)."""
    wander: float = 0.0
    """Part of the motion that did not repeat from turn to turn late at full depth, as a share of the rms: 0 for a
    stable cut, and for a flip of an even number of teeth. A cut above its limit may be stable where run-out keeps teeth
    out of it."""


def simulate_cut(cut: MillingCut, passage: Passage | None = None) -> TipMotion:
    """What the tip does in one cut."""
    return next(simulate_cuts([cut], passage))[1]


def simulate_cuts(cuts: Sequence[MillingCut], passage: Passage | None = None) -> Iterator[tuple[int, TipMotion]]:
    """Index and tip motion of each cut, in the order in which they are ready: cuts alike are stepped together."""
    passage = passage or Passage()
    for number, cut in enumerate(cuts):
        if cut.pitch:
            yield number, _uneven_motion(cut, passage)
    for group in _groups(cuts):
        members = [cuts[i] for i in group]
        modes, teeth = tables(members, max(map(steps_needed, members)))
        cutting, swing = _cutting(members, modes, teeth, passage)
        for place, number in enumerate(group):
            turn = len(teeth.root) * cuts[number].teeth
            yield number, _motion(cutting[:, place], swing[place], modes, place, passage, turn)


def _uneven_motion(cut: MillingCut, passage: Passage) -> TipMotion:
    modes, tooth = turn_tables(cut)
    swings, gains, swing = uneven_cutting(cut, modes, tooth, passage)
    cutting = _acceleration(swings, gains, modes)[:, 0].astype(np.float32)
    return _motion(cutting, swing, modes, 0, passage, len(tooth.root))


def _groups(cuts: Sequence[MillingCut]) -> Iterator[list[int]]:
    """Indices of cuts to step together, all whose teeth are evenly spaced."""
    group: list[int] = []
    for i in sorted((i for i, cut in enumerate(cuts) if not cut.pitch), key=lambda i: cuts[i].tooth_period):
        if group and (len(group) == TOGETHER or cuts[i].tooth_period > ALIKE * cuts[group[0]].tooth_period):
            yield group
            group = []
        group.append(i)
    if group:
        yield group


def _cutting(
    cuts: Sequence[MillingCut], modes: ModeTables, teeth: ToothTables, passage: Passage
) -> tuple[NDArray[np.float32], NDArray[np.complex128]]:
    """Acceleration from first to last contact (n, c, 2) in m/s^2, and how the modes swing then (c, m)."""
    steps, step = len(teeth.root), modes.step
    periods = math.ceil(passage.cutting / (steps * float(np.min(step))))
    number = np.array([cut.teeth for cut in cuts])[:, np.newaxis]
    runout = np.zeros((len(cuts), int(np.max(number))))
    for row, cut in zip(runout, cuts, strict=True):
        row[: len(cut.runout)] = cut.runout
    surface, swing = np.zeros_like(teeth.thick), np.zeros(modes.flight.shape, dtype=complex)
    record = np.empty((periods * steps, len(cuts), 2), dtype=np.float32)
    for period in range(periods):
        stands_out = np.take_along_axis(runout[np.newaxis], (teeth.place - period) % number, axis=2)
        time = (period * steps + np.arange(steps)[:, np.newaxis] + 0.5) * step
        depth = passage.depth_at(time)
        push, rub = teeth.push, teeth.rub * depth[..., np.newaxis]
        if np.any(depth < 1):
            push = push * depth[..., np.newaxis, np.newaxis]
        room = teeth.thick + teeth.root * stands_out - surface
        swings, gains, chips = _period(swing, modes.flight, teeth.reach, push, rub, room)
        surface += chips - teeth.thick
        swing = swings[-1]
        record[period * steps : (period + 1) * steps] = _acceleration(swings, gains, modes)
    return record, swing


def _period(
    swing: NDArray[np.complex128],
    flight: NDArray[np.complex128],
    reach: Floats,
    push: Floats,
    rub: Floats,
    room: Floats,
) -> tuple[NDArray[np.complex128], Floats, Floats]:
    """A tooth period: how modes swing after each step, what they gained in it (s, c, m), and chips (s, c, e)."""
    swings = np.empty((len(room), *swing.shape), dtype=complex)
    gains, chips = np.empty(swings.shape), np.empty(room.shape)
    columns = (swings.imag[..., np.newaxis], gains[..., np.newaxis], chips[..., np.newaxis])
    rows = zip(swings, swings.real, gains, chips, room, reach, push, rub, *columns, strict=True)
    for now, speed, gain, chip, left, to, by, edge, place, gained, cut in rows:
        np.multiply(swing, flight, out=now)
        np.matmul(to, place, out=cut)
        np.add(chip, left, out=chip)
        np.maximum(chip, 0.0, out=chip)
        np.matmul(by, cut, out=gained)
        np.add(gain, edge, out=gain)
        np.add(speed, gain, out=speed)
        swing = now
    return swings, gains, chips


def _acceleration(swings: NDArray[np.complex128], gains: Floats, modes: ModeTables) -> Floats:
    """q'' = w^2 F / K - 2 zeta w q' - w^2 q along x and y (s, c, 2), in the middle of the impulse of each step."""
    free = np.imag(modes.pole**2 * (swings - gains / 2))
    acceleration: Floats = np.einsum(
        "cam,scm->sca", modes.axis, free + gains * modes.pole.imag / modes.step[:, np.newaxis]
    )
    return acceleration


def _motion(
    cutting: NDArray[np.float32],
    swing: NDArray[np.complex128],
    modes: ModeTables,
    place: int,
    passage: Passage,
    turn: int,
) -> TipMotion:
    """One cut between rest and ringing down; turn: steps of one."""
    step, pole, axis = float(modes.step[place]), modes.pole[place], modes.axis[place]
    n = round((passage.cutting + passage.after) / step)
    left = step * np.arange(1, n - len(cutting) + 1)
    ringing = axis @ np.imag((pole**2 * swing)[:, np.newaxis] * np.exp(np.outer(pole, left)))
    still = np.zeros((2, round(passage.before / step)))
    full = cutting[: round((passage.ramp + passage.steady) / step)]
    return TipMotion(1 / step, np.hstack([still, cutting[:n].T, ringing]), _wander(full, turn))


def _wander(acceleration: NDArray[np.float32], turn: int) -> float:
    """What of the last turns differs from their mean, as a share of the rms; 0 for less than two."""
    number = min(TURNS, len(acceleration) // turn)
    if number < 2:
        return 0.0
    turns = acceleration[-number * turn :].reshape(number, -1).astype(float)
    return float(np.sqrt(np.mean((turns - np.mean(turns, axis=0)) ** 2) / np.mean(turns**2)))
