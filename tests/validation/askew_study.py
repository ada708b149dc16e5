"""Verdicts on spindles with rotated principal directions: random ones, tapped in x and y (and cross), simulated.

The truth is two modes square to each other, 5 to 85 degrees off x and y, within 18 % of each other. Their FRFs are
noisy and fitted as those of a tap test; the limits that are said are held against `delayed_milling`, which shares
nothing with what made them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from delayed_milling import DelayedCase, growth_per_turn
from disturbed_study import FORCES, N_HITS, make_hit
from numpy.typing import NDArray

from acquisition import Circumstances, Frf, TapDirection, TapTest, check_hit, estimate_frf
from lobes import program_limit, project_modes
from lobewatch.machine import FEED_ANGLES, Machine, ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement.tap_measurement import measure
from lobewatch.tool.assembly import Assembly, assemble
from lobewatch.verdicts.program_case import ProgramCase, build_program
from lobewatch.verdicts.program_samples import find_worst_limit
from lobewatch.verdicts.verdict import Stability, Verdict, evaluate_program
from modal import Mode, fit_modes, select_credible_modes, synthesize_frf

MACHINE: Machine = parse_machine_file(
    '[machine]\nname = "random"\n[speed]\nlow_rpm = 1500\nhigh_rpm = 24000\ndrop_percent = [0, 0]\n'
)
"""Machine whose frequencies do not drop at speed, so that only directions decide."""
LINES = np.arange(100.0, 5000.0, 2.0)
NOISE = 0.001
"""Noise of each line of an FRF over its tallest peak."""
TEETH = (2, 3, 4, 5)
IMMERSIONS = (0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.75, 1.0)
DIAMETER_MM = 16.0
DEEPEST_MM = 60.0
"""Limits beyond this are none."""


@dataclass(frozen=True)
class AskewSpindle:
    """Two modes square to each other, with a cut."""

    modes: tuple[Mode, Mode]
    angle: float
    """Angle of the first from x (rad)."""
    cut: ProgramTable
    """Cut at any depth."""

    @property
    def vectors(self) -> NDArray[np.float64]:
        c, s = math.cos(self.angle), math.sin(self.angle)
        return np.array([[c, s], [-s, c]])

    def assembly(self, rng: np.random.Generator, across: bool) -> Assembly:
        """Return the tool as tap tests show it."""
        x, y, cross = (_fitted(modes, rng) for modes in project_modes(self.modes, self.vectors))
        time, sides = datetime(2026, 1, 1, tzinfo=UTC), ("x", "y")
        x, y = (list(select_credible_modes(modes).modes) for modes in (x, y))
        return Assembly("reference", time, "drawn", x, y, sides, None, {}, False, (), cross=cross if across else None)

    def truths(self, depth_mm: float) -> Iterator[DelayedCase]:
        """Yield the cut at a depth in each of its feed directions."""
        cut = MACHINE.build_cut(self.cut)
        angles = np.arange(12) * math.pi / 12 if self.cut.feed == "both" else np.array([FEED_ANGLES[self.cut.feed]])
        for feed in angles.tolist():
            along = zip(self.modes, (self.angle, self.angle + math.pi / 2), strict=True)
            yield DelayedCase(
                tuple((mode.frequency, mode.damping_ratio, mode.stiffness, angle - feed) for mode, angle in along),
                (360 // cut.teeth,) * cut.teeth,
                cut.immersion,
                cut.direction,
                cut.tangential,
                cut.radial,
                0.0,
                self.cut.speed_rpm,
                depth_mm / 1e3,
            )


def _fitted(modes: list[Mode], rng: np.random.Generator) -> list[Mode]:
    receptance = synthesize_frf(modes, LINES).receptance
    noise = NOISE * np.max(np.abs(receptance)) / math.sqrt(2)
    return fit_modes(Frf(LINES, receptance + noise * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))))


def random_spindle(rng: np.random.Generator) -> AskewSpindle:
    frequency, stiffness = rng.uniform(600, 2200), 10 ** rng.uniform(6.9, 7.7)
    others = frequency * (1 + rng.uniform(0, 0.18)), rng.uniform(0.015, 0.045), stiffness * rng.uniform(0.75, 1.35)
    modes = Mode(frequency, rng.uniform(0.015, 0.045), stiffness), Mode(*others)
    teeth, tangential = int(rng.choice(TEETH)), rng.uniform(600, 2000)
    cut = ProgramTable(
        name="drawn",
        teeth=teeth,
        radial_depth_mm=float(rng.choice(IMMERSIONS)) * DIAMETER_MM,
        tool_diameter_mm=DIAMETER_MM,
        direction=rng.choice(["up", "down"]).item(),
        tangential_n_per_mm2=tangential,
        radial_n_per_mm2=tangential * rng.uniform(0.1, 0.6),
        speed_rpm=60 * frequency / teeth / rng.uniform(0.5, 7),
        depth_mm=1.0,
        feed=rng.choice(["x", "y", "both"]).item(),
    )
    return AskewSpindle(modes, math.radians(rng.uniform(5, 85)), cut)


def tapped(spindle: AskewSpindle, rng: np.random.Generator) -> Assembly:
    """Return the tool as ten hits in x and in y show it, with their FRFs."""
    shown, forces = project_modes(spindle.modes, spindle.vectors), tuple(rng.uniform(*FORCES, N_HITS).tolist())
    measured = []
    sides: tuple[tuple[TapDirection, list[Mode]], ...] = (("x", shown.x), ("y", shown.y))
    for direction, modes in sides:
        made = tuple((mode.frequency, mode.damping_ratio, mode.stiffness) for mode in modes)
        hits = tuple(make_hit(made, peak, rng) for peak in forces)
        about = Circumstances("drawn", datetime(2026, 1, 1, tzinfo=UTC), "reference", direction)
        flags = tuple(check_hit(hit) for hit in hits)
        good = [hit for hit, fault in zip(hits, flags, strict=True) if not fault]
        measured.append(measure(TapTest(direction, about, estimate_frf(good), hits, flags), MACHINE))
    return assemble(measured[1], measured[0], {})


def true_limit_mm(spindle: AskewSpindle) -> float:
    """Lowest limit (mm) of the true modes over the feed directions."""
    cut = MACHINE.build_cut(spindle.cut)
    angles = np.arange(12) * math.pi / 12 if spindle.cut.feed == "both" else np.array([FEED_ANGLES[spindle.cut.feed]])
    fed = [replace(cut, feed_angle=angle) for angle in angles.tolist()]
    first, second = spindle.modes
    return 1e3 * program_limit(build_program(spindle.cut, MACHINE), [first], [second], fed, spindle.vectors).limit


def verdicts_from_hits(count: int, seed: int, shares: tuple[float, ...]) -> dict[float, list[Stability]]:
    """Return the verdicts at shares of the true limit on random spindles, from hits in x and y."""
    words: dict[float, list[Stability]] = {share: [] for share in shares}
    made = 0
    for rng in np.random.default_rng(seed).spawn(4 * count):
        spindle = random_spindle(rng)
        limit = true_limit_mm(spindle)
        if made == count or limit >= DEEPEST_MM:
            continue
        made, tool = made + 1, tapped(spindle, rng)
        for share in shares:
            words[share].append(evaluate_program(_at(spindle.cut, share * limit), tool, MACHINE).stability)
    return words


@dataclass(frozen=True)
class Saying:
    """Predicted limits of a spindle at half its limit."""

    spindle: AskewSpindle
    verdict: Verdict

    @property
    def low_mm(self) -> float:
        return 1e3 * self.verdict.limit_low


def sayings(count: int, seed: int, across: bool = False) -> list[Saying]:
    """Return predictions for so many random spindles that have a limit, each with a plausible cut."""
    made = list[Saying]()
    for rng in np.random.default_rng(seed).spawn(4 * count):
        spindle = random_spindle(rng)
        tool = spindle.assembly(rng, across)
        limit, _, _ = find_worst_limit(ProgramCase(spindle.cut, tool, MACHINE))
        if 1e3 * limit.limit < DEEPEST_MM and len(made) < count:
            verdict = evaluate_program(_at(spindle.cut, 1e3 * limit.limit / 2), tool, MACHINE)
            made += [Saying(spindle, verdict)] if verdict.stability is not Stability.UNKNOWN else []
    return made


def _at(cut: ProgramTable, depth_mm: float) -> ProgramTable:
    return ProgramTable(**{name: getattr(cut, name) for name in cut.__struct_fields__} | {"depth_mm": depth_mm})


def hold(said: list[Saying], share: float) -> NDArray[np.bool_]:
    """Return for each truth if it is stable in the simulation at a share of the low end of its prediction."""
    cases = [(i, case) for i, saying in enumerate(said) for case in saying.spindle.truths(share * saying.low_mm)]
    growth, cycles = np.empty(len(cases)), [max(m[0] for m in case.modes) / case.speed_rpm for _, case in cases]
    for part in np.array_split(np.argsort(cycles), -(-len(cases) // 60)):
        growth[part] = growth_per_turn([cases[i][1] for i in part])
    stable = np.ones(len(said), dtype=bool)
    np.logical_and.at(stable, [i for i, _ in cases], growth < 0)
    return stable
