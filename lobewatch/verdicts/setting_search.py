"""Looking for settings that would be called stable, with something to spare.

A diagram by zero order says where to look. What is recommended has been judged like any program: `weigh` finds it
stable throughout, and the same draws are stable as the spindle will be when it is tapped again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import msgspec
import numpy as np
from numpy.typing import NDArray

from lobewatch.machine import Machine, ProgramTable, drive_limit
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.series import fall_in
from lobewatch.verdicts.aging import StiffnessAt, age, softening
from lobewatch.verdicts.drawn_limits import ALIKE
from lobewatch.verdicts.draws import ProgramDraws
from lobewatch.verdicts.judgement import weigh
from lobewatch.verdicts.promise import Promise
from lobewatch.verdicts.spindle_at_speed import SpindleAtSpeed

SPARE = 0.20
"""Depth that a recommended setting has to spare in the middle of the doubt."""
MOST_SPARE = 20.0
"""Depth to spare that stands for more too, and for no limit: no deeper is looked."""
INTERVALS = 2
"""Number of tap intervals that it must last ..."""
UNKNOWN_FALL = 0.02
"""... or fall of the frequency that it must stand where no rate is known; chosen."""
RPM, MM = 10.0, 0.05
"""Steps that can be set at a machine; numbers are rounded inwards to them."""
DEPTHS = np.geomspace(0.2, 1.0, 9)
"""Shares of what the diagram promises that are looked at with a few draws ..."""
LESS = (0.95, 0.88, 0.8)
"""... and shares of what they leave that are judged."""
PLACES = 4
"""Number of pockets that are looked at closely."""
LATER = np.array([0.0, 0.5, 1.0])
"""Shares of the fall that a setting must stand at which it is looked at."""
FEW = 24
"""Number of draws that a setting is looked at with before all of them decide, the hardest where they are known."""
EDGE, WIDEST = 0.006, 8
"""Relative step of a window of speeds, and most steps on each side."""
LEFT = np.arange(0, 0.1001, 0.01)
"""Falls of the frequency that a setting is looked at with; more than the last is not told apart."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """A speed and a depth that would be called stable."""

    speed_rpm: float
    """Spindle speed (rpm), in steps of 10 unless it is the program's own."""
    depth_mm: float
    """Axial depth (mm), in steps of 0.05 unless it is the program's own."""
    window_rpm: tuple[float, float]
    """Slowest and fastest speed around it at which the depth would be called stable too."""
    depth_margin: float
    """Limit in the middle of the doubt over depth, less 1."""
    frequency_left: float
    """Fall of the frequency that it stands, relative, and is still called stable; 0.1 stands for that and more."""


def needed_fall(assembly: Assembly, machine: Machine) -> float:
    """Fall of the frequency that a recommended setting must stand: two tap intervals at the rate so far."""
    days = INTERVALS * machine.machine.tap_interval_days
    falls = [fall_in(series, days) for series in assembly.series.values()]
    return max((UNKNOWN_FALL if fall is None else fall for fall in falls), default=UNKNOWN_FALL)


@dataclass(frozen=True, eq=False)
class SettingSearch:
    """Looking for settings of one program with a tool that is surely known."""

    program: ProgramTable
    """Program with the coefficients that were learnt."""
    draws: ProgramDraws
    """Draws of the program, in the worst directions of feed."""
    assembly: Assembly
    """Tool as tapped."""
    machine: Machine
    """Machine, with its speeds, its drive and its tap interval."""
    at_speed: SpindleAtSpeed
    """Spindle as test cuts have taught it."""
    stiffness_at: StiffnessAt
    """Stiffness over that of now by the fall of the frequency."""
    fall: float
    """Fall of the frequency that a setting must stand, relative."""
    promise: Promise
    """Depths that are likely to be safe: where to look."""

    @classmethod
    def of(
        cls, program: ProgramTable, draws: ProgramDraws, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed
    ) -> SettingSearch:
        """The search around a program that was drawn."""
        fall = needed_fall(assembly, machine)
        promise = Promise.of(program, draws, at_speed.moved(assembly), machine, fall, SPARE)
        worst = draws.fed(ALIKE * float(draws.limits[0]), 2)
        return cls(program, worst, assembly, machine, at_speed, softening(assembly)[0], fall, promise)

    def elsewhere(self) -> Setting | None:
        """The nearest window of speeds at the program's depth."""
        depth = self.program.depth_mm
        middles = sorted(self.promise.middles(depth), key=self._distance)
        return next(filter(None, (self._verified(_rounded(speed), depth) for speed in middles[:PLACES])), None)

    def most_chips(self) -> Setting | None:
        """The speed and depth of largest removal rate."""
        return next(filter(None, (self._deepest(*place) for place in self._calm(self.promise.tops()))), None)

    def pockets(self, count: int) -> list[Setting]:
        """The settings of largest removal rate, one a pocket.

        Each in the middle of the speeds that are promised to be safe now and after the fall.
        """
        places = self._calm(self.promise.pockets())
        settings = (self._deepest(_rounded(self.promise.middle(*place)), place[1]) for place in places)
        return list(islice(filter(None, settings), count))

    def _calm(self, tops: Sequence[int]) -> list[tuple[float, float]]:
        """Speeds (rpm) and depths (mm) there at which a few draws are stable, the largest removal rate first."""
        promised = [(_rounded(float(self.promise.speeds[i])), self.promise.depths[i]) for i in tops[:PLACES]]
        places = [(speed, self._calm_depth(speed, depth_mm)) for speed, depth_mm in promised]
        return sorted(places, key=lambda place: -place[0] * place[1])

    def here(self, depth_mm: float) -> Setting | None:
        """The deepest at the program's own speed, up to a depth (mm)."""
        speed = self.program.speed_rpm
        return self._deepest(speed, self._calm_depth(speed, min(depth_mm, self.program.deepest_mm)))

    def _deepest(self, speed: float, depth_mm: float) -> Setting | None:
        settings = (self._verified(speed, depth) for share in LESS if (depth := _floored(share * depth_mm)) > 0)
        return next(filter(None, settings), None)

    def _calm_depth(self, speed: float, depth_mm: float) -> float:
        """The deepest up to a depth (mm) at which, and below which, a few draws are stable now and later."""
        depths = depth_mm * DEPTHS
        calm = np.all(self._early(speed, FEW // 2).growth(depths / 1e3) < 0, axis=0)
        return float(depths[calm.size - 1 if np.all(calm) else np.argmin(calm) - 1]) if calm[0] else 0.0

    def _early(self, speed: float, number: int = FEW) -> ProgramDraws:
        """A few draws at a speed (rpm), now and when the spindle is tapped again."""
        few = self.draws[np.arange(number)].at(speed / self.program.speed_rpm)
        return age(few, self.fall * LATER[[0, -1]], self.stiffness_at)

    def _lasts(self, speed: float, depth: float) -> bool:
        """Whether a few draws are stable at a speed (rpm) and depth (m) now and when the spindle is tapped again."""
        return bool(np.all(self._early(speed).growth(depth) < 0))

    def _distance(self, speed: float) -> float:
        return abs(math.log(speed / self.program.speed_rpm))

    def _verified(self, speed: float, depth_mm: float) -> Setting | None:
        """The setting where it is stable throughout, and will be when the spindle is tapped again."""
        table = msgspec.structs.replace(self.program, speed_rpm=speed, depth_mm=depth_mm)
        if not self.machine.speed.low_rpm <= speed <= self.machine.speed.high_rpm:
            return None
        if not self._lasts(speed, depth_mm / 1e3):
            return None
        depth, deepest = depth_mm / 1e3, drive_limit(self.machine, table, np.array([speed]))[0]
        judgement = weigh(table, self.assembly, self.machine, self.at_speed)
        margin = judgement.middle.limit / depth - 1
        if not judgement.is_stable_throughout or margin < SPARE or depth > deepest:
            return None
        near = judgement.draws.fed(2 * depth)
        later = age(near, self.fall * LATER[1:], self.stiffness_at).growth(depth)
        if np.any(later >= 0):
            return None
        hardest = near[np.argsort(np.max(later.reshape(LATER.size - 1, -1), axis=0))[-FEW:]]
        window, left = self._window(near, hardest, speed, depth), self._left(hardest, depth)
        return Setting(speed, depth_mm, window, min(margin, MOST_SPARE), left)

    def _window(self, near: ProgramDraws, hardest: ProgramDraws, speed: float, depth: float) -> tuple[float, float]:
        steps = np.arange(WIDEST + 1.0)
        low, high = self.machine.speed.low_rpm, self.machine.speed.high_rpm
        slow, fast = (_last_calm(near, hardest, np.power(1 + EDGE, sign * steps), depth) for sign in (-1, 1))
        slowest, fastest = max(speed * slow, low) / RPM, min(speed * fast, high) / RPM
        return min(math.ceil(slowest) * RPM, speed), max(math.floor(fastest) * RPM, speed)

    def _left(self, hardest: ProgramDraws, depth: float) -> float:
        grown = age(hardest, LEFT, self.stiffness_at).growth(depth).reshape(LEFT.size, -1)
        return float(LEFT[_calm_from_the_first(grown)])


def _last_calm(near: ProgramDraws, hardest: ProgramDraws, ratio: Floats, depth: float) -> float:
    """The last of these speeds, over the present one, up to which all draws are stable."""
    last = _calm_from_the_first(hardest.swept(ratio).growth(depth).reshape(ratio.size, -1))
    while last > 0 and np.any(near.at(speed=float(ratio[last])).growth(depth) >= 0):
        last //= 2
    return float(ratio[last])


def _calm_from_the_first(grown: Floats) -> int:
    """Row up to which all of growth (k, draws) is negative from the first on."""
    calm = np.all(grown < 0, axis=1)
    return calm.size - 1 if np.all(calm) else max(int(np.argmin(calm)) - 1, 0)


def _rounded(speed: float) -> float:
    return round(speed / RPM) * RPM


def _floored(depth_mm: float) -> float:
    return round(math.floor(depth_mm / MM + 1e-9) * MM, 6)
