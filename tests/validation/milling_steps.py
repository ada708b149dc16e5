"""Milling stepped through time, many cases at once, as deviation from the periodic motion.

The periodic motion under the feed is an exact solution whatever the machine: each tooth meets the surface that the one
before it left in the same motion, so its chips are feed sin(phi). Stepped here is the deviation from it,
d = q - q_periodic, and that of the surface, u, both in units of the feed per tooth:

    chip          h = sin(phi) + n . d - u,  n = (sin(phi), cos(phi)); no force where h < 0
    surface left  u <- max(u - sin(phi), n . d), the furthest material of all passes at this angle and height
    force         F = -b (Kt (cos, -sin) + Kr (sin, cos)) (max(h, 0) - sin(phi))

While all teeth cut this is F = -b H(phi) (q(t) - q(t - tau)) without any rest, and no rounding of the large periodic
part hides a small deviation. Between steps the modes swing freely, which is exact; the force of a step acts as one
impulse in its middle (Stoermer-Verlet with exact flight: second order, explicit, without numerical damping). Complex
modes jump with an impulse: the force is that of the tip half way, to second order.

Process damping: while a tooth cuts, its flank resists its velocity out of the cut, F = -b C / V (n . d') n with the
surface speed V = pi D rpm / 60. The velocity is that half way through the impulse, found by iteration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Modes = tuple[tuple[float, float, float], ...]
"""Frequency (Hz), damping ratio and stiffness (N/m) of each mode."""
ComplexModes = tuple[tuple[float, float, float] | tuple[float, float, float, float], ...]
"""Modes, optionally with the phase of the modal constant (deg)."""

CYCLE, PERIOD, ARC = 40, 60, 30
"""Fewest steps in a cycle of the fastest mode (as stiffened by the cut), in a tooth period, and in the arc of cut."""
LAG = 0.3
"""Largest lag between two slices of a helical tooth (rad)."""
FEWEST_SLICES = 5
PART = 0.02
"""Lag of the parts of a slice over which its angles in the cut are averaged (rad)."""
DAMPED, SMALL = 3, 0.2
"""Iterations of the velocity half way through an impulse, and the largest share of it that process damping takes."""
SAMPLES = 24
"""Times a tooth period at which the deviation is recorded."""


@dataclass(frozen=True)
class Case:
    """A cut on a machine: x is the feed, y the normal to it, the tooth angle phi runs clockwise from +y.

    Raises ValueError for modes that do not swing and for what is no cut.
    """

    x: ComplexModes
    """Modes in machine x, none to six."""
    y: ComplexModes
    """Modes in machine y."""
    feed_angle: float
    """From machine x to the feed (rad): the feed is (cos, sin), the normal to it (-sin, cos)."""
    teeth: int
    immersion: float
    """Radial depth of cut over cutter diameter, above 0 up to 1."""
    direction: Literal["up", "down"]
    tangential: float
    """Kt (Pa)."""
    radial: float
    """Kr (Pa)."""
    helix_lag: float
    """2 tan(helix) / diameter (rad/m)."""
    speed_rpm: float
    depth: float
    """Axial depth (m)."""
    process_damping: float = 0.0
    """C (N/m)."""
    diameter: float = math.nan
    """Cutter diameter (m), of which the speed of the surface follows."""

    def __post_init__(self) -> None:
        """Reject cases that cannot be simulated."""
        modes = self.x + self.y
        if not modes or not all(f > 0 and 0 < zeta < 1 and k > 0 for f, zeta, k, *_ in modes):
            raise ValueError(f"modes {modes} need frequency > 0, damping ratio in (0, 1), stiffness > 0, one at least")
        if self.teeth < 1 or not 0 < self.immersion <= 1 or self.direction not in ("up", "down"):
            raise ValueError(f"{self.teeth} teeth, immersion {self.immersion}, {self.direction!r} is no cut")
        if min(self.tangential, self.speed_rpm, self.depth) <= 0 or min(self.radial, self.helix_lag) < 0:
            raise ValueError("Kt, speed and depth must be > 0, Kr and the helix lag >= 0")
        if self.process_damping < 0 or (self.process_damping and not self.diameter > 0):
            raise ValueError("process damping must be >= 0, and needs a diameter > 0")

    @property
    def arc(self) -> tuple[float, float]:
        """Angles where a tooth enters and leaves the cut (rad)."""
        if self.direction == "up":
            return 0.0, math.acos(1 - 2 * self.immersion)
        return math.acos(2 * self.immersion - 1), math.pi

    @property
    def tooth_period(self) -> float:
        """From tooth to tooth (s)."""
        return 60 / (self.teeth * self.speed_rpm)

    @property
    def slices(self) -> int:
        """Slices along the axis."""
        lag = self.helix_lag * self.depth
        return max(FEWEST_SLICES, math.ceil(lag / LAG)) if lag > 0 else 1

    @property
    def steps(self) -> int:
        """Steps a tooth period."""
        entry, leave = self.arc
        pitch = 2 * math.pi / self.teeth
        at_once = math.ceil((leave - entry) / pitch)
        cut = self.depth * math.hypot(self.tangential, self.radial) * at_once
        fastest = max(f * math.sqrt(1 + cut / k) for f, _, k, *_ in self.x + self.y)
        rate = self.damping_per_velocity * at_once * sum((2 * math.pi * f) ** 2 / k for f, _, k, *_ in self.x + self.y)
        resolved = max(CYCLE * fastest, rate / SMALL) * self.tooth_period
        return math.ceil(max(resolved, PERIOD, ARC * pitch / (leave - entry)))

    @property
    def damping_per_velocity(self) -> float:
        """Force of a tooth in the cut over its velocity out of it (N s/m)."""
        surface_speed = math.pi * self.diameter * self.speed_rpm / 60
        return self.depth * self.process_damping / surface_speed if self.process_damping else 0.0


class Stepper:
    """Cases c that share a number of steps a tooth period, from a random small start.

    Arrays: modes (m, c), teeth and slices in cut at a step e, directions feed and normal 2.
    """

    def __init__(self, cases: Sequence[Case], steps: int, perturbation: float, rng: np.random.Generator) -> None:
        """Lay out tables; `perturbation` is in units of the feed per tooth."""
        most = max(len(case.x + case.y) for case in cases)
        modal = [_modal(case, steps, most) for case in cases]
        self._flight = np.stack([flight for flight, _, _ in modal], axis=-1)
        self._shape = np.stack([shape for _, shape, _ in modal], axis=-1)
        self._kick = np.stack([kick for _, _, kick in modal], axis=-1)
        self._pace = np.stack([_pace(case, most) for case in cases], axis=-1)
        self._resist = np.stack([_resistance(case, steps, most) for case in cases], axis=-1)
        self._jump = np.einsum("imc,jmc->ijc", self._shape, self._kick.imag)
        tables = [_normals(case, steps) for case in cases]
        self._normal = np.zeros((steps, 2, max(table.shape[2] for table in tables), len(cases)))
        for i, table in enumerate(tables):
            self._normal[:, :, : table.shape[2], i] = table
        self._surface = np.zeros((steps, *self._normal.shape[2:]))
        push = rng.normal(size=(2, *self._flight.shape)) * np.any(self._shape, axis=0)
        self._swing = perturbation * (push[0] + 1j * push[1])

    def keep(self, which: NDArray[np.bool_]) -> None:
        """Go on with some of the cases only."""
        for name in ("_flight", "_shape", "_kick", "_pace", "_resist", "_jump", "_normal", "_surface", "_swing"):
            setattr(self, name, np.ascontiguousarray(getattr(self, name)[..., which]))

    def run(self, periods: int) -> Floats:
        """Deviation over so many tooth periods more, in units of the feed per tooth, shape (c, periods, samples, 2)."""
        steps, swing = len(self._normal), self._swing
        recorded = np.linspace(0, steps, SAMPLES, endpoint=False).astype(int)
        record = np.empty((periods, SAMPLES, 2, swing.shape[1]))
        history, jumps = np.empty((steps, 2, swing.shape[1])), bool(np.any(self._jump))
        damped = bool(np.any(self._resist))
        for period in range(periods):
            for normal, surface, d in zip(self._normal, self._surface, history, strict=True):
                np.multiply(swing, self._flight, out=swing)
                np.einsum("imc,mc->ic", self._shape, swing.imag, out=d)
                thinner = np.minimum(surface - np.einsum("iec,ic->ec", normal, d), normal[0])
                if jumps:
                    d += np.einsum("ijc,jec,ec->ic", self._jump, normal, thinner) / 2
                    thinner = np.minimum(surface - np.einsum("iec,ic->ec", normal, d), normal[0])
                surface -= thinner
                kick = np.einsum("imc,ic->mc", self._kick, np.einsum("iec,ec->ic", normal, thinner))
                swing += kick + self._damping(swing, kick, normal * (thinner < normal[0])) if damped else kick
            record[period] = history[recorded]
        return np.moveaxis(record, -1, 0)

    def _damping(self, swing: Floats, kick: Floats, normal: Floats) -> Floats:
        """Swing of the process damping of a step, shape (m, c), of a swing before its impulse."""
        given = np.zeros_like(swing)
        for _ in range(DAMPED):
            half_way = (swing + (kick + given) / 2) * self._pace
            velocity = np.einsum("imc,mc->ic", self._shape, half_way.imag)
            out = np.einsum("iec,ic->ec", normal, velocity)
            given = -np.einsum("imc,ic->mc", self._resist, np.einsum("iec,ec->ic", normal, out))
        return given


def _modal(case: Case, steps: int, most: int) -> tuple[NDArray[np.complex128], Floats, NDArray[np.complex128]]:
    """Flight (most,) over a step, feed and normal (2, most) of a swing, swing of a step's force sums (2, most).

    A real mode swings as a = (q' + zeta w q) / w_d + i q: free flight is a factor, a force changes the real part. After
    an impulse the tip moves as Im(A w^2 / w_d exp(lambda t)), A = exp(i phase) / K: complex modes are kicked at an
    angle.
    """
    f, zeta, k, phase = np.array([(*mode, 0.0)[:4] for mode in case.x + case.y]).T
    w, step = 2 * np.pi * f, case.tooth_period / steps
    damped = w * np.sqrt(1 - zeta**2)
    c, s = math.cos(case.feed_angle), math.sin(case.feed_angle)
    along = np.repeat([[c, s], [-s, c]], [len(case.x), len(case.y)], axis=1)
    force = case.depth * np.array([[case.radial, case.tangential], [-case.tangential, case.radial]])
    flight, shape, kick = np.zeros(most, dtype=complex), np.zeros((2, most)), np.zeros((2, most), dtype=complex)
    flight[: f.size] = np.exp((-zeta * w + 1j * damped) * step)
    shape[:, : f.size] = along
    kick[:, : f.size] = force.T @ along * step * w**2 / (k * damped) * np.exp(1j * np.radians(phase))
    return flight, shape, kick


def _pace(case: Case, most: int) -> NDArray[np.complex128]:
    """Velocity over swing in free flight (1/s), shape (most,)."""
    f, zeta, *_ = np.array([mode[:2] for mode in case.x + case.y]).T
    pace = np.zeros(most, dtype=complex)
    pace[: f.size] = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    return pace


def _resistance(case: Case, steps: int, most: int) -> NDArray[np.complex128]:
    """Swing of a step's velocities out of the cut, (2, most), by process damping."""
    resist = np.zeros((2, most), dtype=complex)
    if not case.process_damping:
        return resist
    f, zeta, k, phase = np.array([(*mode, 0.0)[:4] for mode in case.x + case.y]).T
    w, step = 2 * np.pi * f, case.tooth_period / steps
    c, s = math.cos(case.feed_angle), math.sin(case.feed_angle)
    along = np.repeat([[c, s], [-s, c]], [len(case.x), len(case.y)], axis=1)
    size = case.damping_per_velocity * step * w / (k * np.sqrt(1 - zeta**2))
    resist[:, : f.size] = along * size * np.exp(1j * np.radians(phase))
    return resist


def _normals(case: Case, steps: int) -> Floats:
    """Outward normals of the engaged edge at each step, (steps, 2, e), times the root of its share of the depth.

    Roots, because chip and force carry one factor each. A helical slice stands as two halves, one standard deviation of
    its angles in the cut before and after their mean, so that its force matrix is right to the second moment.
    """
    share, mean, spread = _in_cut(case, steps)
    angle = mean
    if case.slices > 1:
        angle, share = np.hstack([mean - spread, mean + spread]), np.hstack([share, share]) / 2
    table = np.sqrt(share) * np.array([np.sin(angle), np.cos(angle)])
    most = max(1, int(np.max(np.sum(share > 0, axis=1))))
    first = np.argsort(share == 0, axis=1, kind="stable")[:, :most]
    return np.take_along_axis(table, first[np.newaxis], axis=2).swapaxes(0, 1)


def _in_cut(case: Case, steps: int) -> tuple[Floats, Floats, Floats]:
    """Return share of depth in cut, mean and standard deviation of its angles, for each tooth and slice at each step.

    Each (steps, teeth * slices), over the turn of the step and the lag along the slice.
    """
    step = 2 * np.pi / (case.teeth * steps)
    lag = case.helix_lag * case.depth
    parts = max(1, math.ceil(lag / (case.slices * PART)))
    along = (np.arange(case.slices * parts) + 0.5) / (case.slices * parts)
    first = step * np.arange(case.teeth * steps).reshape(case.teeth, steps).T[..., np.newaxis] - lag * along
    first = np.mod(first + np.pi / 2, 2 * np.pi) - np.pi / 2
    begin, end = np.maximum(first, case.arc[0]), np.minimum(first + step, case.arc[1])
    shape = (steps, case.teeth * case.slices, parts)
    inside, middle = np.maximum(end - begin, 0).reshape(shape), (begin + end).reshape(shape) / 2
    total = inside.sum(axis=-1)
    part = inside / np.where(total > 0, total, 1)[..., np.newaxis]
    mean = (part * middle).sum(axis=-1)
    variance = (part * ((middle - mean[..., np.newaxis]) ** 2 + inside**2 / 12)).sum(axis=-1)
    return total / (step * along.size), mean, np.sqrt(variance)
