"""The one search for settings that would be called stable, with something to spare: advice, pockets, recommendations.

Zero order and the multipliers of the middle say where to look (`LikelyDepths`), few draws how deep (`HardDraws`). What
is recommended has been judged like any program: `weigh` finds it stable throughout, and the same draws are stable
around it and as the spindle will be when it is tapped again (`room`). Where no speed of the grid has such a depth,
nothing is recommended.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from lobes import Cut, Program
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.cut_range import MM, RPM, CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.aging import StiffnessAt, softening
from lobewatch.verdicts.doubt import Doubt, doubt_of
from lobewatch.verdicts.draws import DRAWS, ProgramDraws
from lobewatch.verdicts.hard_draws import HardDraws, deepest_calm, hard_draws
from lobewatch.verdicts.judgement import SURELY, Judgement, drawn_program, weighed
from lobewatch.verdicts.likely_depths import LikelyDepths, likely_depths
from lobewatch.verdicts.needed_fall import needed_fall
from lobewatch.verdicts.room import APART, DEEPER, all_around, frequency_left, window_rpm
from lobewatch.verdicts.setting import Setting
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.ways import ways

SPARE = 0.20
"""Depth that a recommended setting has to spare in the middle of the doubt."""
MOST_SPARE = 20.0
"""Depth to spare that stands for more too, and for no limit: no deeper is looked."""
MOST_PLACES = 12
"""Number of speeds that few draws are looked at at before it is said that there is none."""
HOPE = 1.1
"""A speed is looked at where the depth that is likely times this, and times the largest share of such a depth that few
draws have left elsewhere, would be more chips than are known of."""
NEAR = np.concatenate([sign * np.array([0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04]) for sign in (-1, 1)])
"""Relative distances of speeds that are looked at beside that of most chips ..."""
CLIMBS = 2
"""... and number of times that they are."""
SEVERAL = 3
"""Number of speeds judged in vain that say what is left at others of their pocket."""
TRIES, MOST_TRIES = 4, 12
"""Number of depths that are judged at one speed, and at all of them."""
NEARLY = 0.85
"""Share of a depth that is wanted, where so much is likely it may be safe too."""
REMEMBERED = 8
"""Draws of each judgement that are remembered where they chatter."""
LESS = 0.98
"""Share of a depth, at least as much less of which is looked at where draws chatter."""
FEW = 24
"""Number of draws, the hardest, that bound a window before all of them decide."""

Floats = NDArray[np.float64]
Depths = dict[float, float]
"""Depths (mm) that may be safe, by speeds (rpm)."""
Shares = dict[float, float]
"""Shares that all draws left of the depths that few allowed, by speeds (rpm) that were judged in vain."""


@dataclass(frozen=True, eq=False)
class SettingSearch:
    """Looking for settings of one cut with a tool that is surely known."""

    table: ProgramTable
    """Cut, with the coefficients that were learnt; its own speed and depth do not count."""
    assembly: Assembly
    """Tool as tapped."""
    machine: Machine
    """Machine, with its speeds, its drive and its tap interval."""
    at_speed: SpindleAtSpeed = AT_REST
    """Spindle as test cuts have taught it."""
    either: bool = False
    """Direction left open: milled up or down, the worse counts."""
    hard: dict[float, HardDraws] = field(default_factory=dict)
    """Few draws by speed (rpm), with those that were known to chatter when they were asked last."""
    chattered: set[int] = field(default_factory=set)
    """Draws that have chattered where few others made it seem safe."""
    judged: dict[tuple[float, float], Judgement] = field(default_factory=dict)
    """Judgements of the settings that were found, by speed (rpm) and depth (mm)."""

    @cached_property
    def spindle(self) -> Assembly:
        """The tool in the middle of what was learnt."""
        return self.at_speed.moved(self.assembly)

    @cached_property
    def reach(self) -> CutRange:
        """Speeds and depths that may be recommended."""
        return CutRange.of(self.machine, self.table)

    @cached_property
    def cuts(self) -> tuple[Cut, ...]:
        """Cuts that it makes on its way."""
        return ways(self.table, self.machine, self.spindle, self.either)

    @cached_property
    def fall(self) -> float:
        """Fall of the frequency that a setting must stand, relative."""
        return needed_fall(self.assembly, self.machine)

    @cached_property
    def doubt(self) -> Doubt:
        """What is not known."""
        return self.at_speed.doubt or doubt_of(self.assembly, self.table, self.machine)

    @cached_property
    def stiffness_at(self) -> StiffnessAt:
        """Stiffness over that of now by the fall of the frequency."""
        return softening(self.assembly)[0]

    @cached_property
    def likely(self) -> LikelyDepths:
        """Where to look."""
        return likely_depths(self.reach, self.cuts, self.spindle, self.doubt, self.fall, SPARE)

    @cached_property
    def best(self) -> Setting | None:
        """The setting of largest removal rate at the same feed per tooth; None where nothing is safe."""
        return next(self._settings(), None)

    def pockets(self, count: int) -> list[Setting]:
        """The best setting, and the next best of other pockets."""
        taken: list[Setting] = []
        for setting in self._settings(taken):
            taken.append(setting)
            if len(taken) == count:
                break
        return taken

    def nearest(self, depth_mm: float, speed_rpm: float) -> Setting | None:
        """A depth (mm) at the window of speeds nearest to one (rpm)."""
        return self._first_at(depth_mm, lambda speed: abs(math.log(speed / speed_rpm)))

    def fastest(self, depth_mm: float) -> Setting | None:
        """A depth (mm) at the fastest window of speeds."""
        return self._first_at(depth_mm, lambda speed: -speed)

    def here(self, speed_rpm: float, most_mm: float) -> Setting | None:
        """The deepest at a speed (rpm), up to a depth (mm)."""
        if self.best is None or not self.reach.low_rpm <= speed_rpm <= self.reach.high_rpm:
            return None
        return self._deepest(speed_rpm, min(most_mm, self._calm(speed_rpm)))

    def _first_at(self, depth_mm: float, rank: Callable[[float], float]) -> Setting | None:
        """A depth (mm) in the first window of speeds where it is safe, the lowest rank first; else where most is."""
        for speed in self._windows(depth_mm, rank):
            if self.reach.holds(speed, depth_mm) and self._calm(speed) >= depth_mm:
                setting = self.verified(speed, depth_mm)
                if isinstance(setting, Setting):
                    return setting
        return None

    def _windows(self, depth_mm: float, rank: Callable[[float], float]) -> Iterator[float]:
        """Speeds (rpm) to look for a depth (mm) at; that of most chips, which takes a search, is the last."""
        if self.reach.is_empty:
            return
        middles = {*self.likely.middles(depth_mm), *self.likely.middles(NEARLY * depth_mm)}
        yield from map(_rounded, sorted(middles, key=rank)[:MOST_PLACES])
        if self.best is not None:
            yield self.best.speed_rpm

    def _settings(self, taken: Sequence[Setting] = ()) -> Iterator[Setting]:
        """The deepest at speeds of the grid, the most chips first as far as few draws tell.

        What was judged in vain comes back with less depth, and the draws that chattered count from then on. Pockets
        that are taken while it goes on are passed over.
        """
        if self.reach.is_empty:
            return
        tops = [(_rounded(speed), depth) for speed, depth in self.likely.tops(MOST_PLACES)][::-1]
        depths, kept = Depths(), Shares()
        looked, left = set[float](), 0.0
        for _ in range(MOST_TRIES):
            tops = [top for top in tops if self._is_free(top[0], taken)]
            depths = {speed: depth for speed, depth in depths.items() if self._is_free(speed, taken)}
            speed = self._most_chips(depths, kept)
            while tops and HOPE * left * math.prod(tops[-1]) >= speed * depths.get(speed, 0.0):
                top, likely = tops.pop()
                depths[top] = self.reach.floored(self._calm(top))
                left, speed = max(left, depths[top] / likely), self._most_chips(depths, kept)
            if not depths.get(speed):
                return
            speed = self._climbed(speed, depths, kept, looked)
            if not self._is_free(speed, taken):
                continue
            setting = self.verified(speed, depths[speed])
            if isinstance(setting, Setting):
                del depths[speed]
                yield setting
            else:
                kept[speed] = kept.get(speed, 1.0) * setting / depths[speed]
                depths[speed] = self.reach.floored(setting)

    def _is_free(self, speed: float, taken: Sequence[Setting]) -> bool:
        """Whether a speed (rpm) lies in none of the pockets that are taken."""
        return not any(self.likely.is_joined(speed, setting.speed_rpm) for setting in taken)

    def _climbed(self, speed: float, depths: Depths, kept: Shares, looked: set[float]) -> float:
        """The speed (rpm) of most chips when those beside it have joined these with a depth (mm), once for each top."""
        for _ in range(0 if speed in looked else CLIMBS):
            looked.add(speed)
            if (beside := self._beside(speed, depths[speed])) in looked:
                break
            looked.add(beside)
            depths[beside] = self.reach.floored(self._calm(beside))
            speed = self._most_chips(depths, kept)
        return speed

    def _most_chips(self, depths: Depths, kept: Shares) -> float:
        """The speed (rpm) of most chips, of these with the depth (mm) that few draws allow; 0 where there is none."""
        while True:
            speed = max(depths, key=lambda speed: speed * depths[speed] * self._share(speed, kept), default=0.0)
            if not speed or self.hard[speed].chattered == self.chattered:
                return speed
            depths[speed] = min(depths[speed], self.reach.floored(self._calm(speed)))

    def _share(self, speed: float, kept: Shares) -> float:
        """Share of its depth that is likely to be left at a speed (rpm), when several of its pocket were judged."""
        shares = [share for other, share in kept.items() if self.likely.is_joined(speed, other)]
        return 1.0 if speed in kept or len(shares) < SEVERAL else max(shares)

    def _beside(self, speed: float, depth_mm: float) -> float:
        """A speed (rpm) near one at which few draws let pass more chips than at a depth (mm) there; itself else."""
        speeds = np.round(speed * (1 + NEAR) / RPM) * RPM
        depths = (np.floor(speed * depth_mm / speeds / MM) + 1) * MM
        held = [self.reach.holds(*place) for place in zip(speeds.tolist(), depths.tolist(), strict=True)]
        if not any(held):
            return speed
        grown = self.hard[speed].growth_beside(speeds[held] / speed, depths[held] / 1e3)
        return float(speeds[held][np.argmin(grown)]) if np.min(grown) < 0 else speed

    def _calm(self, speed: float) -> float:
        """The deepest (mm) at a speed (rpm) at which few draws are stable now and later, with depth to spare."""
        most = float(self.reach.depths(np.array([speed]))[0]) / 1e3
        hard = self.hard[speed] = replace(self._hard(speed), chattered=frozenset(self.chattered))
        return 1e3 * hard.deepest(most)

    def _hard(self, speed: float) -> HardDraws:
        """The few draws at a speed (rpm)."""
        if speed in self.hard:
            return self.hard[speed]
        likely = float(np.interp(speed, self.likely.speeds, self.likely.depths)) / 1e3
        program = Program(self.machine.build_cut(self.table), speed, max(likely, MM / 1e3))
        spindle = self.spindle, self.doubt, self.fall, self.stiffness_at
        return hard_draws(program, self.cuts, *spindle, SPARE)

    def _deepest(self, speed: float, depth_mm: float) -> Setting | None:
        """The deepest setting up to a depth (mm)."""
        for _ in range(TRIES):
            if not (depth_mm := self.reach.floored(depth_mm)):
                return None
            setting = self.verified(speed, depth_mm)
            if isinstance(setting, Setting):
                return setting
            depth_mm = min(setting, self._calm(speed))
        return None

    def verified(self, speed: float, depth_mm: float) -> Setting | float:
        """The setting where it is stable throughout now and when it is tapped again; else a depth (mm) that may be."""
        table, depth = msgspec.structs.replace(self.table, speed_rpm=speed, depth_mm=depth_mm), depth_mm / 1e3
        deep = DEEPER * depth
        program = drawn_program(table, self.assembly, self.machine, self.at_speed, self.either)
        limit = program.middle.limit
        if limit < depth * (1 + SPARE):
            return 1e3 * limit / (1 + SPARE)
        near = program.draws.fed_where(program.draws.around(SURELY * deep, self.fall, APART) >= 0)
        around = all_around(near, self.fall, self.stiffness_at)
        grown = around.growth_that_counts(deep)
        if np.any(grown >= 0):
            return self._less(around, grown, depth_mm)
        judgement = weighed(program)
        if not judgement.is_stable_throughout:
            places = 1 + np.flatnonzero(judgement.chatters)
            self.chattered.update(places[:REMEMBERED].tolist())
            calm = min(deepest_calm(program.draws[places[:FEW]], depth), judgement.lowest)
            return min(1e3 * calm, LESS * depth_mm, depth_mm - MM)
        hardest = near[np.argsort(np.max(grown.reshape(-1, len(near.rows)), axis=0))[-FEW:]]
        window = window_rpm(near, hardest, speed, depth, self.reach)
        left = frequency_left(hardest, depth, self.stiffness_at)
        self.judged[speed, depth_mm] = judgement
        return Setting(speed, depth_mm, window, min(limit / depth - 1, MOST_SPARE), left)

    def _less(self, draws: ProgramDraws, grown: Floats, depth_mm: float) -> float:
        """A depth (mm) that these draws may let pass, which grow by so much at one (mm) with room (n,)."""
        places = np.argsort(-grown)[:FEW]
        self.chattered.update((places[grown[places] >= 0] % (DRAWS + 1))[:REMEMBERED].tolist())
        return min(1e3 * deepest_calm(draws[places], DEEPER * depth_mm / 1e3) / DEEPER, depth_mm - MM)


def _rounded(speed: float) -> float:
    return round(speed / RPM) * RPM
