"""Ordinary cuts along the ladder, and suggested test cuts, on hidden spindles in listed materials with process damping.

Truths are drawn here, evenly over the published ranges. Slots of four teeth have a constant force, so their exact
characteristic equation with process damping (below) decides each cut and gives the optimum. Cuts are entered as the
commands do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Literal

import msgspec
import numpy as np
from first_setting_study import MATERIALS
from numpy.typing import NDArray

from lobes.materials import fold_material_name, materials_by_name
from lobewatch.cuts.learning.program_learning import build_cut_grid, find_next_cut, learn_program
from lobewatch.logbook.production import climb
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.folder_updates import make_observed_cut
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.tool.assembly import Assembly
from modal import Mode

Floats = NDArray[np.float64]
Modes = tuple[tuple[float, float, float], ...]
"""Frequency (Hz), damping ratio and stiffness (N/m) of each mode."""
Policy = Literal["production", "search"]

TEETH, DIAMETER, FEED, DEEPEST = 4, 0.012, 8e-5, 0.012
"""Slots of four teeth: diameter, feed per tooth and largest depth (m)."""
LOBES, DAMPED_LOBES = (1.0, 6.0), (8.0, 25.0)
"""Waves between two teeth at the highest and the lowest speed, without and with process damping."""
MOST_PROCESS_DAMPING = 5e5
"""Largest C (N/m)."""
TAP_ERRORS, MOST_DROP = (0.001, 0.03, 0.01), 0.05
"""Errors of a tap test (relative), and largest drop of all frequencies at speed."""
DAMPING_AT_SPEED, STIFFNESS_AT_SPEED = (0.8, 1.4), (0.85, 1.15)
"""Damping ratio and stiffness at speed over those of the tap test."""
SHOWN, READ, DULL, EDGE_LENGTH = (0.85, 1.2), 0.05, (0.5, 1.5), 2.5e-5
"""Displayed power over that of the cuts, error of a reading, Kte over Kt (m) and its factor."""
FREQUENCY_ERROR = 0.004
"""Relative error of a chatter frequency."""
START = datetime(2026, 3, 2, 8, tzinfo=UTC)


@dataclass
class HiddenSpindle:
    """A spindle, its material, and the cuts made so far."""

    number: int
    seed: int = 560
    has_power: bool = True
    """True if the power of each cut is entered."""
    mislabelled: int = 0
    """Cut that is entered as the opposite, from 1; 0 for none."""
    gain: float = 1.0
    """Error of the drive on top of that of usual drives."""
    cuts: list[CutEntry] = field(default_factory=list)
    chattered: list[bool] = field(default_factory=list)

    def __post_init__(self) -> None:
        draw = self.random = np.random.default_rng((self.seed, self.number))
        self.is_damped = self.number % 2 == 1
        self.material = MATERIALS[(self.number // 2) % len(MATERIALS)]
        listed = materials_by_name()[fold_material_name(self.material)]
        assert listed.tangential_range is not None
        assert listed.ratio_range is not None
        x = _draw_modes(draw)
        y = tuple(
            (f * draw.uniform(0.9, 1.1), z * draw.uniform(0.8, 1.25), k * draw.uniform(0.7, 1.4)) for f, z, k in x
        )
        self.tangential = draw.uniform(*listed.tangential_range)
        self.radial = self.tangential * draw.uniform(*listed.ratio_range)
        self.process_damping = draw.uniform(0, 1) * MOST_PROCESS_DAMPING if self.is_damped else 0.0
        drop = draw.uniform(0, MOST_DROP)
        self.x, self.y = (_at_speed(modes, drop, draw) for modes in (x, y))
        self.tool = _tapped(x, y, draw)
        self.machine = self._machine(x[0][0])
        self.table = self.machine.program[0]
        grid = build_cut_grid(self.table, self.tool, self.machine)
        self.speeds = grid.speeds
        self.limits = np.minimum(slot_limits(self, self.speeds)[0], DEEPEST)
        self.optimum = float(np.max(self.speeds * self.limits))
        self.shown, self.dull = draw.uniform(*SHOWN) * self.gain, draw.uniform(*DULL)

    def _machine(self, frequency: float) -> Machine:
        waves = DAMPED_LOBES if self.is_damped else LOBES
        fastest, slowest = (round(60 * frequency / TEETH / number) for number in waves)
        program = {"name": "A", "tool": "reference", "teeth": TEETH, "tool_diameter_mm": 1e3 * DIAMETER}
        program |= {"radial_depth_mm": 1e3 * DIAMETER, "feed_per_tooth_mm": 1e3 * FEED, "direction": "down"}
        program |= {"material": self.material, "speed_rpm": fastest, "depth_mm": 0.2, "feed": "x"}
        table = msgspec.convert(program, ProgramTable)
        speeds = f"low_rpm = {slowest}\nhigh_rpm = {fastest}"
        edges = math.pi * DIAMETER * slowest * 0.9, math.pi * DIAMETER * fastest * 1.1
        tool = f'[[tool]]\nname = "reference"\ncutting_speed_m_min = [{edges[0]:.4f}, {edges[1]:.4f}]'
        bare = parse_machine_file(f'[machine]\nname = "drawn"\n[speed]\n{speeds}\n{tool}\n')
        return msgspec.structs.replace(bare, all_programs=(table,))

    def next_cut(self, policy: Policy, count: int) -> tuple[float, float] | None:
        """Speed (rpm) and depth (m) of the next cut, or None if there is none."""
        if policy == "search":
            found = find_next_cut(self.table, self.tool, self.machine, self.cuts, count).suggestion
            return None if found is None else (found.speed_rpm, found.depth)
        learning = learn_program(self.table, self.tool, self.machine, self.cuts)
        ladder = climb(learning, build_cut_grid(self.table, self.tool, self.machine), self.machine, count=1)
        step = next(iter(ladder.steps), None)
        return None if step is None else (step.speed_rpm, step.depth)

    def make(self, speed_rpm: float, depth: float) -> None:
        """Make a cut and enter it, a day after the one before it."""
        limit, frequency = (float(part[0]) for part in slot_limits(self, np.array([speed_rpm])))
        chatters = depth > limit
        heard = chatters != (self.mislabelled == len(self.cuts) + 1)
        frequency *= 1 + FREQUENCY_ERROR * self.random.standard_normal()
        setting = find_cut_setting(self.machine, "A", speed_rpm, 1e3 * depth, self._power_kw(speed_rpm, depth))
        hz = frequency if heard and chatters else None
        entry = make_observed_cut(
            setting, "chatter" if heard else "stable", None, START + timedelta(days=len(self.cuts))
        )
        self.cuts.append(replace(entry, id=f"c{len(self.cuts) + 1}", chatter_frequency_hz=hz))
        self.chattered.append(chatters)

    def _power_kw(self, speed_rpm: float, depth: float) -> float | None:
        """Return the displayed power (kW): chips and edges of two teeth at all times, within what the command takes."""
        if not self.has_power:
            return None
        per_depth = DIAMETER * TEETH * speed_rpm / 60 * self.tangential * (FEED + self.dull * EDGE_LENGTH * math.pi / 2)
        return 1e-3 * depth * per_depth * self.shown * (1 + READ * self.random.standard_normal())

    def reached(self, count: int) -> float:
        """Largest removal rate of the first cuts that were stable and were entered so, over the optimum."""
        pairs = zip(self.cuts[:count], self.chattered[:count], strict=True)
        stable = [cut.speed_rpm * cut.depth for cut, chatters in pairs if not chatters and not cut.has_chatter]
        return min(max(stable, default=0.0) / self.optimum, 1.0)


def _draw_modes(draw: np.random.Generator) -> Modes:
    """One or two modes, the second faster and stiffer."""
    f, zeta, k = draw.uniform(600, 2200), draw.uniform(0.015, 0.045), draw.uniform(8e6, 4e7)
    return ((f, zeta, k), (f * draw.uniform(1.35, 2.2), zeta, k * draw.uniform(1.5, 8)))[: int(draw.integers(1, 3))]


def _at_speed(modes: Modes, drop: float, draw: np.random.Generator) -> Modes:
    damped, stiff = draw.uniform(*DAMPING_AT_SPEED), draw.uniform(*STIFFNESS_AT_SPEED)
    return tuple((f * (1 - drop), zeta * damped, k * (1 - drop) ** 2 * stiff) for f, zeta, k in modes)


def _tapped(x: Modes, y: Modes, draw: np.random.Generator) -> Assembly:
    def measured(modes: Modes) -> list[Mode]:
        errors = 1 + np.array(TAP_ERRORS) * draw.standard_normal((len(modes), 3))
        return [Mode(*mode) for mode in (np.array(modes) * errors).tolist()]

    sides = measured(x), measured(y)
    return Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "drawn", *sides, ("x", "y"), None, {}, False, ())


def slot_limits(spindle: HiddenSpindle, speeds: Floats) -> tuple[Floats, Floats]:
    """Limits (m) and their chatter frequencies (Hz) of a slot of four teeth at speeds (rpm), inf and NaN without one.

    det(I + b M G) = 0 with M = (1 - exp(-s T)) [[Kr, Kt], [-Kt, Kr]] + s C / V I and s = i w: the sums of n n' and of
    the force directions of the two teeth in the cut are the same at all angles. The lowest real b over all w counts.
    Sources: Altintas, Manufacturing Automation, 2nd ed., ch. 4.8; F = b C / V v_r: Tyler & Schmitz, 2013.
    """
    own = [mode[0] for mode in (*spindle.x, *spindle.y)]
    w = 2 * np.pi * np.linspace(0.6 * min(own), 1.8 * max(own), 6000)
    gx, gy = _receptance(w, spindle.x), _receptance(w, spindle.y)
    limits, frequencies = np.full(speeds.shape, np.inf), np.full(speeds.shape, np.nan)
    for place, speed in enumerate(speeds):
        wave = 1 - np.exp(-1j * w * 60 / (TEETH * speed))
        velocity = np.pi * DIAMETER * speed / 60
        along = wave * spindle.radial + 1j * w * spindle.process_damping / velocity
        across = wave * spindle.tangential
        half, product = along * (gx + gy) / 2, (along**2 + across**2) * gx * gy
        root = np.sqrt(half**2 - product)
        root[1:] *= np.cumprod(np.where(np.real(root[1:] * np.conj(root[:-1])) < 0, -1.0, 1.0))
        for depth in (-1 / (half + root), -1 / (half - root)):
            at = np.flatnonzero((depth.imag[1:] < 0) != (depth.imag[:-1] < 0))
            share = depth.imag[at] / (depth.imag[at] - depth.imag[at + 1])
            crossed = depth.real[at] + share * (depth.real[at + 1] - depth.real[at])
            smooth = np.abs(depth[at + 1] - depth[at]) < 0.3 * np.abs(depth[at])
            good = (crossed > 0) & smooth
            if np.any(good) and np.min(crossed[good]) < limits[place]:
                best = at[good][np.argmin(crossed[good])]
                limits[place], frequencies[place] = np.min(crossed[good]), w[best] / (2 * np.pi)
    return limits, frequencies


def _receptance(w: Floats, modes: Modes) -> NDArray[np.complex128]:
    """Displacement at the tip by a force (m/N)."""
    f, zeta, k = np.array(modes).T[..., np.newaxis]
    ratio = w / (2 * np.pi * f)
    return np.asarray(np.sum(1 / (k * (1 - ratio**2 + 2j * zeta * ratio)), axis=0))


def run(spindles: Sequence[HiddenSpindle], policy: Policy, count: int = 5) -> None:
    """Cut by a policy; in production without a step, the best stable cut goes on."""
    for spindle in spindles:
        for _ in range(count):
            if (place := spindle.next_cut(policy, count)) is None:
                break
            spindle.make(*place)
