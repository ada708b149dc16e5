"""Emulated device that records cuts with the accelerometer on the spindle housing, again and again.

Spindle and cut differ from the tapped machine and from machine.toml by a hidden truth.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from acquisition import Driver, EmulatorThread, SensorInput, Structure, emulation
from acquisition.emulation import MillingCut, Passage, SignalFunction
from dsm import Spindle
from lobes import Cut, Program, program_limit
from lobewatch.cuts.learning.prior_samples import ROTATING_FORCE_PRIOR
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.settings.cut_tables import FEED_ANGLES
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tap.emulated_spindle import build_structure, emulate_device, get_spindle_table, map_signal_to_inputs
from lobewatch.verdicts import program_samples as rotating
from modal import Mode

DEFAULT_PASSAGE = Passage(before=2.0, ramp=0.1, steady=2.8, after=2.0)
"""Passage with times in air, cut and air (s), again and again."""
MAX_MODE_STIFFNESS_RATIO, MAX_EMULATED_MODE_FREQUENCY = 100.0, 6000.0
"""Stiffness over that of the softest mode, and frequency (Hz), above which modes are left out, chosen.

A cut hardly moves them, but steps for them take long.
"""
HOUSING_GAIN_FREQUENCIES = np.arange(100.0, 8000.0, 2.0)
"""Frequencies of cuts and chatter (Hz)."""
DEFAULT_FEED_SHARE = 5e-3
"""Feed per tooth over diameter if machine.toml does not state it, chosen."""
DEFAULT_EDGE_COEFFICIENTS = (25e3, 35e3)
"""Tangential and radial edge coefficients (N/m) if unknown, about those of aluminium."""
HIDDEN_FREQUENCY_FACTOR = (0.985, 0.02)
"""Mean and standard deviation of natural frequencies at speed over those not rotating; chosen."""
MIN_HIDDEN_FACTOR = 0.3
"""Smallest random factor as a share of its median, chosen."""
MAX_SPEED_DEVIATION = 0.015
"""Largest relative deviation of the spindle speed from the commanded one, chosen."""
MAX_RUNOUT = 20e-6
"""Largest eccentricity of a tool in its holder (m), chosen."""


class ModeFactors(NamedTuple):
    """Factors on the modes of one direction."""

    frequency: float
    """Factor on the natural frequencies (-)."""
    damping_ratio: float
    """Factor on the damping ratios (-)."""
    stiffness: float
    """Factor on the stiffnesses (-)."""

    def apply_to(self, at_rest: Structure) -> Structure:
        """Return the structure at speed from that at rest."""
        frequency, zeta, stiffness = at_rest.frequency, at_rest.damping_ratio, at_rest.stiffness
        return Structure(frequency * self.frequency, zeta * self.damping_ratio, stiffness * self.stiffness)


class HiddenTruth(NamedTuple):
    """Unmeasured factors of the emulated machine."""

    x: ModeFactors
    """Factors on the modes in x."""
    y: ModeFactors
    """Factors on the modes in y."""
    tangential: float
    """Factor on both cutting coefficients (-)."""
    speed: float
    """Factor on the commanded spindle speed (-)."""

    @property
    def factors(self) -> dict[str, float]:
        """All factors by name."""
        sides = {"x": self.x, "y": self.y}
        modes = {f"{name}_{side}": value for side, mode in sides.items() for name, value in mode._asdict().items()}
        return modes | {"tangential": self.tangential, "speed": self.speed}


class EmulatedCut(NamedTuple):
    """Emulated device and its hidden truth."""

    device: EmulatorThread
    """Emulator that serves while its context lasts."""
    truth: HiddenTruth
    """Hidden truth of the seed."""
    speed_rpm: float
    """True spindle speed (rpm)."""
    limit: float
    """True stable depth limit at this speed and feed direction (m), inf if any depth is stable."""


def emulate_cut(
    folder: MachineFolder,
    driver: Driver,
    setting: CutSetting,
    seed: int = 1,
    *,
    spindle: Spindle | None = None,
    passage: Passage = DEFAULT_PASSAGE,
    **serving: bool,
) -> EmulatedCut:
    """Emulate a cut that repeats, with the accelerometer on the housing and an idle hammer.

    Truth, run-out and housing depend on the seed only, not on the cut. A program fed along both axes is fed along x.
    spindle: replaces the model of the tool. serving: as of `emulate_device`. DataError if machine.toml lacks the
    sensors of a device that does not describe them itself.
    """
    truth, random, noise = draw_hidden_truth(seed), *np.random.default_rng(seed).spawn(2)
    runout = draw_runout(setting.cut, random)
    cut = _build_true_cut(folder, setting, _select_tip_modes(folder, setting, spindle), truth, runout)
    motion = emulation.simulate_cut(cut, passage)
    housing = emulation.make_random_housing(random, cut.speed_rpm)
    largest_gain = float(np.max(np.abs(housing.transfer(HOUSING_GAIN_FREQUENCIES))))  # chatter: no overload
    housing = replace(housing, gain=(housing.gain[0] / largest_gain, housing.gain[1] / largest_gain))

    def signal_of(inputs: Sequence[SensorInput], rate: float) -> SignalFunction:
        return map_signal_to_inputs(inputs, emulation.HousingSignal(motion, housing, cut.speed_rpm, rate, noise))

    device = emulate_device(folder, driver, signal_of, **serving)
    return EmulatedCut(device, truth, cut.speed_rpm, _find_true_limit(cut, setting))


def _select_tip_modes(folder: MachineFolder, setting: CutSetting, spindle: Spindle | None) -> Structure:
    """Return the modes of the tip that a cut moves."""
    table = get_spindle_table(folder)
    model = spindle or (folder.machine.model(setting.tool) if folder.machine.spindle else table.build())
    structure = build_structure(model, table.damping_ratio)
    softest = int(np.argmin(structure.stiffness))
    is_moved = structure.stiffness < MAX_MODE_STIFFNESS_RATIO * structure.stiffness[softest]
    is_moved &= structure.frequency < MAX_EMULATED_MODE_FREQUENCY
    is_moved[softest] = True
    return Structure(structure.frequency[is_moved], structure.damping_ratio[is_moved], structure.stiffness[is_moved])


def _build_true_cut(
    folder: MachineFolder, setting: CutSetting, at_rest: Structure, truth: HiddenTruth, runout: tuple[float, ...]
) -> MillingCut:
    coefficients, cut = folder.machine.coefficients(setting.table), setting.cut
    edges = np.array([coefficients.tangential_edge, coefficients.radial_edge])
    tangential_edge, radial_edge = np.where(np.isfinite(edges), edges, DEFAULT_EDGE_COEFFICIENTS).tolist()
    feed = setting.table.feed_per_tooth_mm or DEFAULT_FEED_SHARE * setting.table.tool_diameter_mm
    unchanged = ("teeth", "entry_angle", "exit_angle", "helix_lag", "pitch")
    return MillingCut(
        **{name: getattr(cut, name) for name in unchanged},
        tangential=cut.tangential * truth.tangential,
        radial=cut.radial * truth.tangential,
        tangential_edge=tangential_edge,
        radial_edge=radial_edge,
        depth=setting.depth,
        feed_per_tooth=feed / 1e3,
        speed_rpm=setting.speed_rpm * truth.speed,
        x=truth.x.apply_to(at_rest),
        y=truth.y.apply_to(at_rest),
        runout=runout,
        feed_angle=FEED_ANGLES.get(setting.feed, 0.0),
    )


def _find_true_limit(cut: MillingCut, setting: CutSetting) -> float:
    """Return the stable depth limit by semi-discretization (m)."""
    sides = [side for side in (cut.x, cut.y) if side is not None]
    x, y = ([*map(Mode, side.frequency, side.damping_ratio, side.stiffness)] for side in sides)
    true_cut = replace(setting.cut, tangential=cut.tangential, radial=cut.radial, feed_angle=cut.feed_angle)
    return program_limit(Program(true_cut, cut.speed_rpm, cut.depth), x, y).limit


def draw_hidden_truth(seed: int) -> HiddenTruth:
    """Draw the hidden truth of a seed, the same for every cut. Modes in x and y differ independently."""
    random = np.random.default_rng([seed, 1])
    priors = HIDDEN_FREQUENCY_FACTOR, rotating.ROTATING_DAMPING_FACTOR, rotating.ROTATING_STIFFNESS_FACTOR
    x, y = (ModeFactors(*(_draw_factor(random, *prior) for prior in priors)) for _ in range(2))
    tangential = _draw_factor(random, *ROTATING_FORCE_PRIOR)
    return HiddenTruth(x, y, tangential, 1 + random.uniform(-MAX_SPEED_DEVIATION, MAX_SPEED_DEVIATION))


def draw_runout(cut: Cut, random: np.random.Generator) -> tuple[float, ...]:
    """Draw the run-out of each tooth of an eccentric tool (m)."""
    angle = np.abs(cut.lead_angles) + random.uniform(0, 2 * np.pi)
    return tuple((random.uniform(0, MAX_RUNOUT) * np.cos(angle)).tolist())


def _draw_factor(random: np.random.Generator, middle: float, spread: float) -> float:
    return float(middle * max(1 + spread * random.standard_normal(), MIN_HIDDEN_FACTOR))
