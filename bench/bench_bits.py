"""Measure the accuracy that a converter costs: whole tap tests of one spindle at 24, 16 and 12 bits.

`python bench/bench_bits.py [EMULATED_TESTS]`: tests for each converter (20), ten good hits each,
through the emulated TAPS/1 device. Prints errors of f, zeta and K against the emulated truth, and their difference from
those of 24 bits with the same hits.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition import HammeredStructure, Hammering, Structure, TapsEmulator
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, build_structure
from lobewatch.tap.session import plan_session

PICO_BITS = 8.7
"""Effective bits of the RP2040's converter of 12: RP2040 datasheet, section 4.9 (ADC)."""


class Converter(NamedTuple):
    """One converter with what stands before it."""

    name: str
    bits: int
    full_scale: tuple[float, float] = (5.0, 5.0)
    """Full scale of force and acceleration (V)."""
    effective: float | None = None
    """Bits that its own noise leaves; None: no noise of its own."""


CONVERTERS = (
    Converter("24 bits", 24),
    Converter("16 bits", 16),
    Converter("12 bits, hits fill a tenth", 12),
    Converter("12 bits, hits fill two thirds", 12, (1.25, 1.25)),
    Converter("12 bits, 8.7 effective, a tenth", 12, effective=PICO_BITS),
    Converter("12 bits, 8.7 effective, two thirds", 12, (1.25, 1.25), PICO_BITS),
)


class Noisy:
    """A signal with the noise of a converter: that of a quantiser of so many effective bits."""

    def __init__(self, signal: HammeredStructure, converter: Converter, seed: int) -> None:
        self._signal, self._random = signal, np.random.default_rng([seed, 7])
        bits = converter.effective
        volts = np.array(converter.full_scale) * 2 ** (1 - bits) / np.sqrt(12) if bits else np.zeros(2)
        self._rms = (volts / [channel.sensitivity for channel in EMULATED_CHANNELS])[:, np.newaxis]

    def __call__(self, first: int, count: int) -> NDArray[np.float64]:
        signal = self._signal(first, count)
        return np.asarray(signal + self._random.normal(size=signal.shape) * self._rms)


def tapped(structure: Structure, converter: Converter, seed: int) -> NDArray[np.float64]:
    """f (Hz), zeta and K (N/m) of the mode followed and their standard errors, shape (2, 3)."""
    channels = tuple(
        replace(channel, adc_bits=converter.bits, full_scale=volts)
        for channel, volts in zip(EMULATED_CHANNELS, converter.full_scale, strict=True)
    )
    how = Hammering(double_hits=0.0, overloads=0.0)
    signal = Noisy(
        HammeredStructure(structure, EMULATED_SAMPLE_RATE, np.random.default_rng(seed), how), converter, seed
    )
    with (
        tempfile.TemporaryDirectory() as path,
        TapsEmulator(signal, channels, EMULATED_SAMPLE_RATE, realtime=False) as device,
    ):
        make_machine_folder(Path(path) / "m", "surrogate_machine.toml")
        session = plan_session(MachineFolder(Path(path) / "m"), port=device.port)
        session.run()
        mode = session.measurement.followed
    assert mode is not None
    assert mode.covariance is not None
    return np.array([[mode.frequency, mode.damping_ratio, mode.stiffness], np.sqrt(np.diag(mode.covariance))[:3]])


def main(tests: int) -> None:
    """Print a table."""
    with tempfile.TemporaryDirectory() as path:
        make_machine_folder(Path(path) / "m", "surrogate_machine.toml")
        spindle = MachineFolder(Path(path) / "m").machine.spindle
    assert spindle is not None
    structure = build_structure(spindle.build(), spindle.damping_ratio)
    truth = np.array([structure.frequency[0], structure.damping_ratio[0], structure.stiffness[0]])
    results = {
        converter.name: np.array([tapped(structure, converter, seed) for seed in range(tests)])
        for converter in CONVERTERS
    }
    finest = results[CONVERTERS[0].name][:, 0]
    rms: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda x: 100 * np.sqrt(np.mean(x**2, axis=0))  # noqa: E731
    print(f"{'':36}rms error of f, zeta, K (%)        rms difference from 24 bits (%)    in 95 % interval")
    for name, result in results.items():
        error, moved = rms(result[:, 0] / truth - 1), rms(result[:, 0] / finest - 1)
        inside = np.mean(np.abs(result[:, 0] - truth) < 1.96 * result[:, 1], axis=0)
        print(f"{name:36}" + "  ".join(" ".join(f"{x:10.4f}" for x in row) for row in (error, moved)), inside)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
