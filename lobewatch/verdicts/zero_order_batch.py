"""Zero-order approximation (ZOA) of many spindles at once.

With the mean force matrix H0, G = [[Gx, Gxy], [Gxy, Gy]] and tau between two teeth, motion exp(s t) sustains itself
where

    det(I + b (1 - exp(-s tau)) H0 G(s)) = 0:      at the limit s = 2 pi i f_c, beyond it Re s > 0.

Exact where the force does not change over the turn (a slot cut by four teeth), else a first proposal. Source:
Altintas & Budak, Analytical prediction of stability lobes in milling, CIRP Annals 44 (1995) 357-362.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lobes import Cut, MillingRows
from lobes.damped_loop import DampedLoop, LoopParts
from lobes.tooth_force import interval_forces, mean_damping, mean_force, mean_regeneration, rotate_to_machine
from lobewatch.arrays import Complexes, Flags, Floats, Indices

FREQUENCIES_PER_WAVE = 16
"""Smallest number of frequencies per turn of the regeneration phase of the longest delay."""


def refine_frequency_grid(grid: Floats, cut: Cut, teeth: Floats) -> Floats:
    """Add as many frequencies to a rising grid (Hz) (r, k) as the delays of a cut need."""
    longest = max(cut.delays) * cut.teeth / (2 * np.pi)
    low, high = float(np.min(grid)), float(np.max(grid))
    even = np.arange(low, high, float(np.min(teeth)) / longest / FREQUENCIES_PER_WAVE)
    return np.sort(np.hstack((grid, np.broadcast_to(even, (len(grid), even.size)))), axis=1)


def find_uneven_limits(grid: Floats, loop: Complexes, cut: Cut, teeth: Floats) -> tuple[Floats, Floats]:
    """Find the lowest limit (m) and its frequency (Hz) of loops (r, k) with uneven pitch, at tooth frequencies (r, s).

    As `lobes.uneven_limits`: b = -1 / Re(L s) where Im(L s) = 0, between the frequencies on a line; inf and NaN
    where there is none.
    """
    depth, chatter = np.full(teeth.shape, np.inf), np.full(teeth.shape, np.nan)
    for i in range(teeth.shape[1]):
        turned = loop * mean_regeneration(cut, grid / teeth[:, i, np.newaxis])
        before, after = turned[:, :-1], turned[:, 1:]
        crosses = (before.imag < 0) != (after.imag < 0)
        share = before.imag / np.where(crosses, before.imag - after.imag, 1.0)
        real = np.where(crosses, before.real + share * (after.real - before.real), 0.0)
        row, step = np.arange(len(grid)), np.argmin(real, axis=1)
        limited = real[row, step] < 0
        depth[limited, i] = -1 / real[row, step][limited]
        frequency = grid[row, step] + share[row, step] * (grid[row, step + 1] - grid[row, step])
        chatter[limited, i] = frequency[limited]
    return depth, chatter


FREQUENCY_GRID_REACH = 0.7
"""Relative distance from each natural frequency within which frequencies are checked."""
FREQUENCY_GRID_POINTS = 49
"""Number of frequencies near each natural frequency, densest close to it."""
MAX_BATCH_NUMBERS = 300_000
"""Largest number of values computed at once."""
SPEEDS_PER_FREQUENCY_GRID = 10
"""Number of neighbouring speeds with process damping that share their frequencies."""
DAMPED_SPINDLES_AT_ONCE = 100
"""Number of spindles with process damping computed at once, for the processor cache; measured."""
ESTIMATED_LIMITS_AT_ONCE = 1000
"""Number of limits with process damping estimated at once, for the processor cache; measured."""
LEVEL_STEP = 1.35
"""Ratio of two levels of process damping between which limits are interpolated; chosen."""
NEWTON_STEPS = 14
"""Number of Newton steps for a root."""
CONSTANT_FORCE_TOLERANCE = 1e-6
"""Change of the force over a turn, relative to its mean, below which it is constant."""


@dataclass(frozen=True, eq=False)
class ZeroOrderBatch:
    """Many spindles with a cut, represented by its mean force."""

    rows: MillingRows
    """Spindles, each with its cut and feed."""
    force: Floats
    """Mean force matrix of each (Pa) in machine x and y, shape (r, 2, 2)."""

    @classmethod
    def of(cls, rows: MillingRows) -> "ZeroOrderBatch":
        """Build the batch from rows, each fed in its own direction."""
        unit = replace(rows.cut, tangential=1.0, radial=0.0, feed_angle=0.0)
        tangential = mean_force(unit)
        radial = mean_force(replace(unit, radial=1.0)) - tangential
        force = np.multiply.outer(rows.tangential, tangential) + np.multiply.outer(rows.radial, radial)
        return cls(rows, rotate_to_machine(force, rows.feed_angle))

    def __getitem__(self, which: Flags | Indices | slice) -> "ZeroOrderBatch":
        return ZeroOrderBatch(self.rows[which], self.force[which])

    @property
    def damping(self) -> Floats:
        """Mean process damping matrix C / D n n' of each spindle (Pa) in machine x and y, shape (r, 2, 2)."""
        per_coefficient = mean_damping(replace(self.rows.cut, process_damping=1.0, feed_angle=0.0))
        return rotate_to_machine(np.multiply.outer(self.rows.process_damping, per_coefficient), self.rows.feed_angle)

    def limits(self, speed_rpm: Floats, deepest: float = np.inf) -> tuple[Floats, Floats]:
        """Return the lowest limit (m) and its chatter frequency (Hz) at speeds (rpm) (s,), or (r, s) of each row.

        Both of shape (r, s); inf and NaN where there is none, and perhaps where it is more than `deepest` (m).
        """
        speeds = np.broadcast_to(speed_rpm, (len(self.rows), np.shape(speed_rpm)[-1]))
        depth, chatter = np.full(speeds.shape, np.inf), np.full(speeds.shape, np.nan)
        undamped = self.rows.process_damping == 0
        if not np.all(undamped):
            damped = np.flatnonzero(~undamped)
            for few in np.array_split(damped, -(-damped.size // DAMPED_SPINDLES_AT_ONCE)):
                spindles = ZeroOrderBatch(self.rows[few], self.force[few])
                depth[few], chatter[few] = spindles._damped_limits(speeds[few], deepest)
            if np.any(undamped):
                depth[undamped], chatter[undamped] = self[undamped].limits(speeds[undamped], deepest)
            return depth, chatter
        size = max(1, MAX_BATCH_NUMBERS // (speeds.shape[1] * FREQUENCY_GRID_POINTS * self.rows.direction.size))
        for first in range(0, len(self.rows), size):
            part = slice(first, first + size)
            spindles = ZeroOrderBatch(self.rows[part], self.force[part])
            depth[part], chatter[part] = spindles._limits_of_part(speeds[part] * self.rows.cut.teeth / 60, deepest)
        return depth, chatter

    def _damped_limits(self, speeds: Floats, deepest: float) -> tuple[Floats, Floats]:
        """Return limits and chatter frequencies with process damping at speeds (rpm) (r, s)."""
        teeth, cut = speeds * self.rows.cut.teeth / 60, self.rows.cut
        loop, near = self._damped_loop, self._frequency_grid()
        reach = self._damped_range(near, self._receptances(near), teeth, deepest)
        order = np.argsort(np.min(teeth, axis=0))
        depth, chatter = np.empty((2, *teeth.shape))
        for part in np.array_split(order, -(-order.size // SPEEDS_PER_FREQUENCY_GRID)):
            step = float(np.min(teeth[:, part])) * 2 * np.pi / (cut.teeth * max(cut.delays)) / FREQUENCIES_PER_WAVE
            even = np.arange(max(reach[0], step), reach[1], step)
            grid = np.sort(np.hstack((near, np.broadcast_to(even, (len(near), even.size)))), axis=1)
            depth[:, part], chatter[:, part] = loop.limits(grid, teeth[:, part])
        return depth, chatter

    def estimate_limits(self, speed_rpm: Floats, deepest: float) -> tuple[Floats, Floats]:
        """Estimate the results of `limits`, several times faster with process damping.

        Of the limits with process damping 80 % are within 1.5 % and 98 % within 5 %.
        """
        speeds = np.broadcast_to(speed_rpm, (len(self.rows), np.shape(speed_rpm)[-1]))
        depth, chatter = np.empty((2, *speeds.shape))
        damped = np.flatnonzero(self.rows.process_damping if not self.rows.cut.pitch else ())
        others = np.setdiff1d(np.arange(len(self.rows)), damped)
        depth[others], chatter[others] = self[others].limits(speeds[others], deepest)
        size = -(-ESTIMATED_LIMITS_AT_ONCE // speeds.shape[1])
        for few in (damped[first : first + size] for first in range(0, damped.size, size)):
            spindles = ZeroOrderBatch(self.rows[few], self.force[few])
            depth[few], chatter[few] = spindles._estimate_damped_limits(speeds[few], deepest)
        return depth, chatter

    def _estimate_damped_limits(self, speeds: Floats, deepest: float) -> tuple[Floats, Floats]:
        """Estimate limits and chatter frequencies with process damping of evenly spaced teeth.

        At a level of damping, a depth over the tooth frequency, the limits follow as without process damping, and they
        are nearly straight over the level. The true limit is at the level of its own depth.
        """
        teeth, near = speeds * self.rows.cut.teeth / 60, self._frequency_grid()
        step = float(np.min(teeth)) / 2
        even = np.arange(step, float(np.max(near)), step)
        grid = np.sort(np.hstack((near, np.broadcast_to(even, (len(near), even.size)))), axis=1)
        parts, level = self._damped_loop.parts(grid), np.zeros((len(grid), 1))
        limit, chatter = _even_limits_at_level(grid, parts, level, teeth, deepest)
        excess, level = limit.copy(), np.min(limit / teeth, axis=1, keepdims=True)
        is_open = excess > 0
        while np.any(is_open):
            level = LEVEL_STEP * level
            row, column = (np.flatnonzero(np.any(is_open, axis=axis)) for axis in (1, 0))
            place = np.ix_(row, column)
            few = LoopParts(*(part[row] for part in parts))
            reach = min(deepest, LEVEL_STEP**2 * float(np.max(level[row] * teeth[place])))
            higher, frequency = _even_limits_at_level(grid[row], few, level[row], teeth[place], reach)
            left = higher - level[row] * teeth[place]
            share = np.where(higher < deepest, excess[place] / (excess[place] - np.minimum(left, 0.0)), 1.0)
            was_open = is_open[place]
            limit[place] += was_open * share * (higher - limit[place])
            chatter[place] = np.where(was_open, frequency, chatter[place])
            excess[place], is_open[place] = left, was_open & (left > 0)
        return limit, chatter

    @property
    def _damped_loop(self) -> DampedLoop:
        return DampedLoop(self.rows.cut, self.force, self.damping, self._receptances, self._jump)

    def _receptances(self, frequency: Floats) -> tuple[Complexes, Complexes, Complexes]:
        """Return the receptances xx, yy and xy (m/N) at frequencies (Hz) (r, k)."""
        omega = 2 * np.pi * frequency
        xy = self._receptance(omega, 0, 1) if self._is_rotated else np.zeros((1, 1), np.complex128)
        return self._receptance(omega, 0, 0), self._receptance(omega, 1, 1), xy

    def _damped_range(
        self, grid: Floats, receptances: tuple[Complexes, ...], teeth: Floats, deepest: float
    ) -> tuple[float, float]:
        """Return the lowest and highest frequency (Hz) of limits up to a depth (m), among those of a grid (r, k).

        A loop is at most as large as the product of the norms of its factors; the lowest frequency of the grid stands
        for all below, where process damping is weak.
        """
        force, damping = (np.linalg.norm(part, axis=(1, 2))[:, np.newaxis] for part in (self.force, self.damping))
        waves = grid / np.min(teeth, axis=1, keepdims=True)
        flexible = np.sqrt(sum(np.abs(part) ** 2 for part in receptances))
        large = (2 * force + 2 * self.rows.cut.teeth * waves * damping) * flexible * deepest >= 1
        if not np.any(large):
            return 0.0, 0.0
        return 0.0 if np.any(large[:, 0]) else float(np.min(grid[large])), float(np.max(grid[large]))

    def _limits_of_part(self, teeth: Floats, deepest: float) -> tuple[Floats, Floats]:
        """Return limits and chatter frequencies at tooth frequencies (Hz) (r, s)."""
        grid, cut = self._frequency_grid(), self.rows.cut
        if cut.pitch:
            grid = refine_frequency_grid(grid, cut, teeth)
        found = [
            find_uneven_limits(grid, loop, cut, teeth) if cut.pitch else _find_even_limits(grid, loop, teeth, deepest)
            for loop in self._eigenvalues(grid)
        ]
        return _lower_limits(*found)

    def fastest_growth(self, speed_rpm: Floats, depth: float) -> tuple[Floats, Floats]:
        """Return growth (1/s) and frequency (Hz) of the fastest growing motion, at a speed (rpm) each and a depth (m).

        Both of shape (r,).
        """
        tau = 60 / (self.rows.cut.teeth * speed_rpm)
        low, high = 0.9 * np.min(self.rows.frequency, axis=1), 1.3 * np.max(self.rows.frequency, axis=1)
        number = int(np.ceil(np.max((high - low) * tau / np.pi))) * 2 + 2
        root = 1j * (low[:, np.newaxis] + (high - low)[:, np.newaxis] * np.linspace(0, 1, number))
        for _ in range(NEWTON_STEPS):
            value, slope = self._characteristic(root, tau[:, np.newaxis], depth)
            step = value / np.where(slope == 0, 1e-300, slope)
            root = root - step * np.minimum(1.0, 0.3 / tau[:, np.newaxis] / np.maximum(np.abs(step), 1e-12))
        value, slope = self._characteristic(root, tau[:, np.newaxis], depth)
        good = (np.abs(value / slope) * tau[:, np.newaxis] < 1e-3) & (root.imag > 0)
        best = np.argmax(np.where(good, root.real, -np.inf), axis=1)
        fastest = np.where(np.any(good, axis=1), root[np.arange(len(root)), best], np.nan)
        return np.asarray(fastest.real), np.asarray(fastest.imag / (2 * np.pi))

    def _characteristic(self, s: Complexes, tau: Floats, depth: float) -> tuple[Complexes, Complexes]:
        """Return det(I + b (1 - exp(-s tau)) H0 G) and its derivative by s."""
        if np.any(self.rows.process_damping):
            return self._damped_characteristic(s, tau, depth)
        (gx, dx), (gy, dy) = self._receptance_with_derivative(s, 0, 0), self._receptance_with_derivative(s, 1, 1)
        h = self.force[..., np.newaxis]
        wave = np.exp(-np.clip(s.real * tau, -50, 50) - 1j * s.imag * tau)
        gain, dgain = depth * (1 - wave), depth * tau * wave
        trace, dtrace = h[:, 0, 0] * gx + h[:, 1, 1] * gy, h[:, 0, 0] * dx + h[:, 1, 1] * dy
        product = h[:, 0, 0] * h[:, 1, 1] - h[:, 0, 1] * h[:, 1, 0]
        minor, dminor = product * gx * gy, product * (dx * gy + gx * dy)
        if self._is_rotated:
            gxy, dxy = self._receptance_with_derivative(s, 0, 1)
            both = h[:, 0, 1] + h[:, 1, 0]
            trace, dtrace = trace + both * gxy, dtrace + both * dxy
            minor, dminor = minor - product * gxy**2, dminor - 2 * product * gxy * dxy
        slope = dgain * trace + gain * dtrace + 2 * gain * dgain * minor + gain**2 * dminor
        return 1 + gain * trace + gain**2 * minor, slope

    def _damped_characteristic(self, s: Complexes, tau: Floats, depth: float) -> tuple[Complexes, Complexes]:
        """Return det(I + b ((1 - exp(-s tau)) H0 + s C / V N0) G) and its derivative by s."""
        axes, none = ((0, 0), (0, 1), (1, 0), (1, 1)), (np.zeros(1), np.zeros(1))
        (gx, dx), (gy, dy) = self._receptance_with_derivative(s, 0, 0), self._receptance_with_derivative(s, 1, 1)
        gxy, dxy = self._receptance_with_derivative(s, 0, 1) if self._is_rotated else none
        wave = np.exp(-np.clip(s.real * tau, -50, 50) - 1j * s.imag * tau)
        rate = self.rows.cut.teeth * tau / np.pi  # C / V over C / D: 60 / (pi rpm)
        forces = [(self.force[:, i, j, np.newaxis], rate * self.damping[:, i, j, np.newaxis]) for i, j in axes]
        xx, xy, yx, yy = (depth * ((1 - wave) * h + s * n) for h, n in forces)
        dxx, dxy_, dyx, dyy = (depth * (tau * wave * h + n) for h, n in forces)
        trace = xx * gx + (xy + yx) * gxy + yy * gy
        dtrace = dxx * gx + xx * dx + (dxy_ + dyx) * gxy + (xy + yx) * dxy + dyy * gy + yy * dy
        product, flexible = xx * yy - xy * yx, gx * gy - gxy**2
        dproduct = dxx * yy + xx * dyy - dxy_ * yx - xy * dyx
        return 1 + trace + product * flexible, dtrace + dproduct * flexible + product * (
            dx * gy + gx * dy - 2 * gxy * dxy
        )

    @property
    def _jump(self) -> Floats:
        """Velocity of the tip by which complex modes answer a force at once (m/s/N), shape (r, 2, 2)."""
        axes, jump = self.rows.axes, np.zeros((len(self.rows), 2, 2))
        share = self.rows.tip_participation[1] * self.rows.frequency / self.rows.stiffness
        vector = self.rows.vector
        jump[:, axes[:, np.newaxis], axes] = np.einsum("rn,rnp,rnq->rpq", share, vector, vector)
        return jump

    @property
    def _is_rotated(self) -> bool:
        """True if a force in x moves the tip in y."""
        return bool(np.any(np.prod(self.rows.vector, axis=-1)))

    def _receptance(self, frequency: Floats, force: int, shown: int) -> Complexes:
        """Return the receptance from one direction to another at frequencies (rad/s) (r, k)."""
        total = np.zeros(frequency.shape, np.complex128)
        for natural, zeta, stiffness, place, velocity, coupling in self._modes(force, shown):
            r = frequency / natural
            elastic, damped, moving = 1 - r * r, 2 * zeta * r, velocity * r
            share = coupling / (stiffness * (elastic * elastic + damped * damped))
            total.real += (place * elastic + moving * damped) * share
            total.imag += (moving * elastic - place * damped) * share
        return total

    def _receptance_with_derivative(self, s: Complexes, force: int, shown: int) -> tuple[Complexes, Complexes]:
        """Return the receptance from one direction to another at s (r, k) (1/s), and its derivative."""
        total, slope = np.zeros(s.shape, np.complex128), np.zeros(s.shape, np.complex128)
        for natural, zeta, stiffness, place, velocity, coupling in self._modes(force, shown):
            r = s / natural
            flexible = 1 / (stiffness * (1 + (2 * zeta + r) * r))
            part = (place + velocity * r) * flexible
            total += coupling * part
            slope += coupling * (velocity - part * (2 * stiffness * (zeta + r))) * flexible / natural
        return total, slope

    def _modes(self, force: int, shown: int) -> Iterator[list[Floats]]:
        """Yield the modes that a force in one direction moves in another, shape (r, 1) each.

        Natural frequency (rad/s), damping ratio, stiffness (N/m), the shares of its coordinate and of its velocity over
        the natural frequency that the tip shows, and the product of its parts in both directions.
        """
        place, velocity = self.rows.tip_participation
        axes, vector = self.rows.axes.tolist(), self.rows.vector
        if force not in axes or shown not in axes:
            return
        share = vector[..., axes.index(force)] * vector[..., axes.index(shown)]
        parts = self.rows.frequency, self.rows.damping_ratio, self.rows.stiffness, place, velocity, share
        for k in np.flatnonzero(np.any(share, axis=0)):
            yield [part[:, k, np.newaxis] for part in parts]

    def _frequency_grid(self) -> Floats:
        """Return rising frequencies (Hz), dense near the natural ones, shape (r, k)."""
        width = self.rows.damping_ratio[..., np.newaxis]
        around = width * np.sinh(np.linspace(-1, 1, FREQUENCY_GRID_POINTS) * np.arcsinh(FREQUENCY_GRID_REACH / width))
        grid = (self.rows.frequency / (2 * np.pi))[..., np.newaxis] * (1 + around)
        return np.sort(grid.reshape(len(self.rows), -1), axis=1)

    def _eigenvalues(self, grid: Floats) -> list[Complexes]:
        """Return both eigenvalues of H0 G at frequencies (r, k), each followed over them."""
        gx, gy = (self._receptance(2 * np.pi * grid, axis, axis) for axis in (0, 1))
        h = self.force[..., np.newaxis]
        half, product = (h[:, 0, 0] * gx + h[:, 1, 1] * gy) / 2, gx * gy
        if self._is_rotated:
            gxy = self._receptance(2 * np.pi * grid, 0, 1)
            half, product = half + (h[:, 0, 1] + h[:, 1, 0]) * gxy / 2, product - gxy**2
        root = np.sqrt(half**2 - (h[:, 0, 0] * h[:, 1, 1] - h[:, 0, 1] * h[:, 1, 0]) * product)
        root[:, 1:] *= np.cumprod(np.where(np.real(root[:, 1:] * np.conj(root[:, :-1])) < 0, -1.0, 1.0), axis=1)
        return [half + root, half - root]


def _find_even_limits(grid: Floats, loop: Complexes, teeth: Floats, deepest: float) -> tuple[Floats, Floats]:
    """Find the lowest limit (m) and its frequency (Hz) of loops (r, k), at tooth frequencies (r, s).

    A crossing is where f / f_t - arg(L) / pi + 1/2 is whole: b = -1 / (2 Re L). None beyond `deepest` (m) counts.
    """
    angle = np.angle(loop)
    angle[:, 1:] -= 2 * np.pi * np.cumsum(np.rint(np.diff(angle, axis=1) / (2 * np.pi)), axis=1)
    turn = 0.5 - angle / np.pi
    low = np.minimum(loop.real[:, 1:], loop.real[:, :-1]) < -1 / (2 * deepest)
    depth, frequency = np.full(teeth.shape, np.inf), np.full(teeth.shape, np.nan)
    steps = np.flatnonzero(np.any(low, axis=0))
    if not steps.size:
        return depth, frequency
    first, last = steps[0], steps[-1] + 1
    low, grid, real, turn = low[:, first:last], *(part[:, first : last + 1] for part in (grid, loop.real, turn))
    place = grid[:, np.newaxis] / teeth[..., np.newaxis]
    place += turn[:, np.newaxis]
    whole = np.floor(place)
    crosses = whole[..., 1:] != whole[..., :-1]
    crosses &= low[:, np.newaxis]
    row, speed, step = np.unravel_index(np.flatnonzero(crosses), crosses.shape)
    before, after = place[row, speed, step], place[row, speed, step + 1]
    share = (np.maximum(whole[row, speed, step], whole[row, speed, step + 1]) - before) / (after - before)
    crossing = real[row, step] + share * (real[row, step + 1] - real[row, step])
    limit = np.where(crossing < 0, -1 / (2 * np.minimum(crossing, -1e-300)), np.inf)
    begins = np.flatnonzero(np.diff(row * teeth.shape[1] + speed, prepend=-1))
    depth[row[begins], speed[begins]] = np.minimum.reduceat(limit, begins)
    lowest = np.flatnonzero(limit == depth[row, speed])
    row, speed, step, share = row[lowest], speed[lowest], step[lowest], share[lowest]
    frequency[row, speed] = grid[row, step] + share * (grid[row, step + 1] - grid[row, step])
    return depth, frequency


def _even_limits_at_level(
    grid: Floats, parts: LoopParts, level: Floats, teeth: Floats, deepest: float
) -> tuple[Floats, Floats]:
    """Return the limits (m) at a level (r, 1) of process damping, up to a depth, and their frequencies (Hz), (r, s)."""
    limit, chatter = _lower_limits(*(_find_even_limits(grid, loop, teeth, deepest) for loop in parts.damped(level)))
    return np.minimum(limit, deepest), chatter


def _lower_limits(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Return the lower of two limits and its frequency."""
    is_second = second[0] < first[0]
    return np.where(is_second, second[0], first[0]), np.where(is_second, second[1], first[1])


def is_force_constant(cut: Cut) -> bool:
    """Return whether the force is constant over the turn, so that the mean force is exact."""
    force = interval_forces(cut, 64)[0]
    is_even = bool(np.max(np.ptp(force, axis=0)) < CONSTANT_FORCE_TOLERANCE * np.max(np.abs(force)))
    return is_even and not cut.pitch and cut.helix_lag == 0
