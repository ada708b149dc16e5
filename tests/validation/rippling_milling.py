"""Milling whose depth, immersion and speed change while it cuts: ripple, ribs, corners, entry and exit.

Teeth are stepped by equal angles, so that the surface of the part is stored by its angle while the speed ripples:

    chip     h = feed sin(phi) + n . q - u,  n = (sin(phi), cos(phi))
    surface  u <- u - feed sin(phi) + max(h, 0)
    force    F = -b(t) (Kt (cos, -sin) + Kr (sin, cos)) max(h, 0)

Each cut is stepped twice, the second time with a knock at its beginning. A stable cut forgets it. Chatter goes on with
another phase, whatever ripples.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.emulation import TipMotion
from lobes import Cut, stability_boundary
from modal import Mode

Floats = NDArray[np.float64]
Kind = Literal["steady", "sine", "square", "ribs", "corner"]
KNOCK = 3e-5
"""Displacement of each mode by the knock (m)."""
APART, TOGETHER = 0.1, 2e-3
"""Distance of the two motions at the end, relative to their size, above which a cut chatters and below which not."""
STEPS_PER_CYCLE = 26
AIR, RAMP = 0.5, 0.06
"""Time in air before and after a cut, and time in which it enters and leaves (s)."""


@dataclass(frozen=True)
class RipplingCut:
    """A cut with its ripple; SI units."""

    cut: Cut
    x: tuple[Mode, ...]
    y: tuple[Mode, ...]
    speed_rpm: float
    limit: float
    depth: float
    feed: float
    runout: tuple[float, ...]
    kind: Kind
    ripple_hz: float
    loudness: float
    """Amplitude of the depth over its mean."""
    speed_ripple: float
    """Amplitude of the speed over its mean."""
    seconds: float
    """Time in the part."""
    first: float = 0.0
    """Time in the part from which it is as deep as this, before that at 0.3 of the limit (s)."""
    last: float = math.inf

    def depth_at(self, time: Floats) -> Floats:
        """Depth at times from the beginning of the entry (m)."""
        swing = np.sin(2 * np.pi * self.ripple_hz * time)
        share = 1 + self.loudness * (np.sign(swing) if self.kind in ("square", "ribs") else swing)
        if self.kind == "ribs":
            share = np.where(np.mod(time * self.ripple_hz, 1) < 0.35, 1 - self.loudness, 1.0)
        if self.kind in ("steady", "corner"):
            share = np.ones_like(time)
        inside = np.clip(np.minimum(time, self.seconds - time) / RAMP, 0, 1)
        deep = (time >= self.first) & (time < self.last)
        return np.asarray(np.where(deep, self.depth, min(self.depth, 0.3 * self.limit)) * share * inside)

    def is_in_corner(self, time: Floats) -> NDArray[np.bool_]:
        """Return whether the tool is in a corner, where it is as wide as a half more, for a sixth of a second."""
        return np.asarray((self.kind == "corner") & (np.mod(time, 0.8) > 0.8 - 1 / 6))


def draw_cuts(
    seed: int, count: int, chatters: bool, seconds: tuple[float, float] = (1.5, 4.0)
) -> Iterator[RipplingCut]:
    """Draw cuts of 1 to 6 teeth at 3000 to 24 000 rpm; depths over the limit: at most 0.8, or at least 1.25."""
    random = np.random.default_rng(seed)
    while count:
        teeth = int(random.integers(1, 7))
        x, y = _modes(random), _modes(random)
        immersion = [random.uniform(0.1, 0.3), random.uniform(0.3, 0.95), 1.0][int(random.integers(0, 3))]
        tangential = random.uniform(5e8, 1.5e9)
        cut = Cut(teeth, immersion, random.choice(["up", "down"]), tangential, tangential * random.uniform(0.1, 0.6))
        speed = 60 * random.uniform(100, 1600) / teeth
        if chatters and random.random() < 0.3:  # as the classic rule says: tooth passing next to chatter
            speed = 60 * x[0].frequency / teeth / int(random.integers(1, 5)) * random.uniform(0.95, 1.03)
        kind = random.choice(["sine", "sine", "square", "ribs", "corner", "steady"]).item()
        loudness, speed_ripple = random.uniform(0, 0.4), random.choice([0.0, random.uniform(0, 2e-3)])
        if not 3000 <= speed <= 24000:
            continue
        try:
            limit = min(_limit(x, y, each, speed) for each in (cut, replace(cut, immersion=min(1.5 * immersion, 1.0))))
        except ArithmeticError:
            continue
        if not math.isfinite(limit) or limit < 1e-4:
            continue
        share = random.uniform(1.25, 2.2) if chatters else random.uniform(0.3, 0.8) / (1 + loudness)
        runout = random.uniform(0, 15e-6) * np.cos(2 * np.pi * np.arange(teeth) / teeth + random.uniform(0, 6.28))
        count -= 1
        yield RipplingCut(
            cut, x, y, float(speed), limit, share * limit, random.uniform(4e-5, 1.5e-4),
            tuple(runout) if teeth > 1 else (0.0,), kind, random.uniform(4, 25), loudness, float(speed_ripple),
            random.uniform(*seconds),
        )  # fmt: skip


def _limit(x: Sequence[Mode], y: Sequence[Mode], cut: Cut, speed: float) -> float:
    """Return the lowest limit of depth (m); ArithmeticError if the modes cannot be solved."""
    return float(stability_boundary(list(x), list(y), cut, [speed], 20e-3).crossings[0, 0])


def _modes(random: np.random.Generator) -> tuple[Mode, ...]:
    frequencies = np.sort(random.uniform(500, 3500, int(random.integers(1, 3))))
    return tuple(Mode(float(f), random.uniform(0.01, 0.05), 10 ** random.uniform(6.8, 7.7)) for f in frequencies)


@dataclass(frozen=True, eq=False)
class Milled:
    """Motion of the tip in a cut, with air before and after, and whether it chatters."""

    motion: TipMotion
    chatters: bool | None
    """None where the two motions say neither."""
    frequency: float
    """Frequency of the largest difference of the two motions (Hz)."""


def mill(cuts: Sequence[RipplingCut], together: int = 24) -> Iterator[tuple[int, Milled]]:
    """Simulate cuts; those of as many teeth and like speed together."""
    order = sorted(range(len(cuts)), key=lambda i: (cuts[i].cut.teeth, cuts[i].speed_rpm))
    groups: list[list[int]] = []
    for i in order:
        group = groups[-1] if groups else []
        alike = group and cuts[group[0]].cut.teeth == cuts[i].cut.teeth
        if not alike or len(group) == together or cuts[i].speed_rpm > 1.6 * cuts[group[0]].speed_rpm:
            groups.append([])
        groups[-1].append(i)
    for group in groups:
        yield from zip(group, _mill_together([cuts[i] for i in group]), strict=True)


def _mill_together(cuts: Sequence[RipplingCut]) -> list[Milled]:
    teeth, turn = cuts[0].cut.teeth, np.array([60 / cut.speed_rpm for cut in cuts])
    fastest = max(mode.frequency for cut in cuts for mode in cut.x + cut.y)
    steps = 60 * math.ceil(max(STEPS_PER_CYCLE * fastest * float(np.max(turn)), 40 * teeth) / 60)
    number = math.ceil(max(cut.seconds / t for cut, t in zip(cuts, turn, strict=True)) * steps)
    angle = 2 * np.pi * np.arange(steps) / steps
    normal = np.array([np.sin(angle), np.cos(angle)])
    ahead = np.array([np.cos(angle), -np.sin(angle)])
    push = np.stack([-(cut.cut.tangential * ahead + cut.cut.radial * normal) for cut in cuts])
    arcs = np.stack([_arc(cut, angle, 1.0) for cut in cuts]), np.stack([_arc(cut, angle, 1.5) for cut in cuts])
    time = np.stack([_time(cut, number, t, steps) for cut, t in zip(cuts, turn, strict=True)])
    depth = np.stack([cut.depth_at(row) for cut, row in zip(cuts, time, strict=True)])
    wide = np.stack([cut.is_in_corner(row) for cut, row in zip(cuts, time, strict=True)])
    path, other = _step_all(cuts, push, arcs, np.diff(time, axis=1, append=time[:, -1:]), depth, wide, steps)
    return [_end(cut, path[:, i], other[:, i], time[i], turn[i] / steps) for i, cut in enumerate(cuts)]


def _time(cut: RipplingCut, number: int, turn: float, steps: int) -> Floats:
    """Time of each step (s)."""
    even = np.arange(number) * (turn / steps)
    rate = 2 * np.pi * cut.ripple_hz
    return np.asarray(even + cut.speed_ripple * (np.cos(rate * even) - 1) / rate)


def _arc(cut: RipplingCut, angle: Floats, wider: float) -> NDArray[np.bool_]:
    immersion = min(wider * cut.cut.immersion, 1.0)
    edge = math.acos(1 - 2 * immersion)
    return np.asarray(angle < edge if cut.cut.direction == "up" else (angle > math.pi - edge) & (angle < math.pi))


def _step_all(
    cuts: Sequence[RipplingCut], push: Floats, arcs: tuple[NDArray[np.bool_], ...], step: Floats, depth: Floats,
    wide: NDArray[np.bool_], steps: int,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return the accelerations of both motions, shape (n, c, 2) each."""
    teeth, count = cuts[0].cut.teeth, len(cuts)
    modes = np.zeros((count, 2, 2, 3))
    modes[..., 0], modes[..., 1], modes[..., 2] = 1000.0, 0.5, 1e15
    for row, cut in zip(modes, cuts, strict=True):
        for axis, of_axis in zip(row, (cut.x, cut.y), strict=True):
            axis[: len(of_axis)] = [(mode.frequency, mode.damping_ratio, mode.stiffness) for mode in of_axis]
    w, zeta, k = 2 * np.pi * modes[..., 0], modes[..., 1], modes[..., 2]
    pole = -zeta * w + 1j * w * np.sqrt(1 - zeta**2)
    gain = w**2 / k / pole.imag
    even = np.median(step, axis=1)[:, np.newaxis, np.newaxis]
    flight = np.exp(pole * even)
    normal = np.array([np.sin(2 * np.pi * np.arange(steps) / steps), np.cos(2 * np.pi * np.arange(steps) / steps)])
    feed = np.array([cut.feed for cut in cuts])[:, np.newaxis]
    runout = np.array([cut.runout for cut in cuts])
    forces = [np.where(arc[:, np.newaxis], push, 0.0) for arc in arcs]
    surface = np.zeros((2, count, steps))
    swing = np.zeros((2, count, 2, 2), dtype=complex)
    record = np.empty((step.shape[1], 2, count, 2), dtype=np.float32)
    behind = (np.arange(teeth) * steps) // teeth
    knocked = np.array([int(max(cut.first, RAMP) / pace) for cut, pace in zip(cuts, even[:, 0, 0], strict=True)])
    is_knock, is_wide = np.isin(np.arange(step.shape[1]), knocked), np.any(wide, axis=0)
    for n in range(step.shape[1]):
        if is_knock[n]:
            swing[1, knocked == n] += 1j * KNOCK
        at = (n - behind) % steps
        swing *= flight * (1 + pole * (step[:, n, np.newaxis, np.newaxis] - even))
        tip = swing.imag.sum(axis=-1)
        rigid = feed * normal[0, at]
        chip = rigid + runout + tip @ normal[:, at] - surface[:, :, at]
        np.maximum(chip, 0.0, out=chip)
        surface[:, :, at] += chip - rigid
        force = forces[0][..., at]
        if is_wide[n]:
            force = np.where(wide[:, n, np.newaxis, np.newaxis], forces[1][..., at], force)
        pushed = (force @ chip[..., np.newaxis])[..., 0] * depth[:, n, np.newaxis]
        swing += (pushed * step[:, n, np.newaxis])[..., np.newaxis] * gain
        record[n] = (pole**2 * swing).imag.sum(axis=-1)
    return np.asarray(record[:, 0], dtype=np.float64), np.asarray(record[:, 1], dtype=np.float64)


def _end(cut: RipplingCut, path: Floats, other: Floats, time: Floats, even: float) -> Milled:
    """Sample evenly in time, say whether the cut chatters, and let it ring down into air."""
    begin, end = cut.first, min(cut.seconds - RAMP, cut.last)
    inside = (time > begin + 0.6 * (end - begin)) & (time < end)
    apart = (path - other)[inside].astype(np.float64)
    distance = float(np.std(apart)) / max(float(np.std(path[inside])), 1e-12)
    chatters = True if distance > APART else False if distance < TOGETHER else None
    size = apart.shape[0]
    power = np.sum(np.abs(np.fft.rfft(apart * np.blackman(size)[:, np.newaxis], axis=0)) ** 2, axis=1)
    frequency = np.fft.rfftfreq(size, even)
    power /= np.maximum(frequency, 100.0) ** 4
    last = int(np.searchsorted(time, cut.seconds))
    steady = np.arange(0, time[last - 1], even)
    sampled = np.array([np.interp(steady, time[:last], path[:last, axis]) for axis in range(2)])
    still = np.zeros((2, round(AIR / even)))
    motion = TipMotion(1 / even, np.hstack([still, sampled, still]))
    return Milled(motion, chatters, float(frequency[np.argmax(power)]))
