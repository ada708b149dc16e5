"""Make the simulated recordings of this folder: `python -m sim_data.make_data [FOLDER]`.

Two tap tests of the example spindle, with good bearings (f1 = 1722 Hz) and with worn ones (1550 Hz): ten hits each as
HDF5, and the FRF as UFF and CSV. Two cuts of the good spindle, one stable and one with chatter, as WAV files from an
accelerometer on the spindle housing.
"""

import math
import sys
import wave
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import (
    STANDARD_GRAVITY,
    Channel,
    Circumstances,
    Description,
    HammeredStructure,
    Hammering,
    SimulatedSource,
    Structure,
    TapTest,
    Trigger,
    average_good_hits,
    capture_hits,
    convert,
    new_tap_id,
    write_tap,
)
from acquisition.emulation import HousingSignal, MillingCut, Passage, make_random_housing, simulate_cut
from dsm import calibrate, modes_at
from lobes import Cut, stability_boundary
from lobewatch.machine.settings.machine_file import parse_machine_file
from modal import Mode

FOLDER = Path(__file__).parent
MACHINE_TOML = (FOLDER / "surrogate_machine.toml").read_text("utf-8")
DAMPING_RATIO = 0.029
"""Damping ratio of every mode, as in the paper of Gaber & Hashemi."""
SPINDLES = {
    "good": (1722.0, datetime(2026, 1, 15, 9, tzinfo=UTC)),
    "worn": (1550.0, datetime(2026, 10, 15, 9, tzinfo=UTC)),
}
"""First natural frequency (Hz) and date of the tap test."""
SENSORS = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))
TAP_RATE = 25_600.0
"""Sample rate of the tap tests (Hz)."""
HITS, SAMPLES, PRE_TRIGGER = 10, 2048, 128
SPEED_RPM, TEETH = 12_000.0, 4
DEPTHS = {"stable": 0.5, "chatter": 2.0}
"""Depth of each cut over its stability limit."""
SOUND_RATE = 12_800
"""Sample rate of the cuts (Hz)."""
FULL_SCALE = 300 * STANDARD_GRAVITY
"""Acceleration at the largest value of a WAV file (m/s^2), 1.2 times the loudest sample of both cuts."""


def build_structure(frequency: float) -> Structure:
    """Return the modes at the tip of the example spindle, whose bearings give the first frequency (Hz)."""
    spindle = calibrate(parse_machine_file(MACHINE_TOML).model("reference"), frequency).spindle
    frequencies, stiffness = modes_at(spindle, 3)
    return Structure(frequencies, np.full(3, DAMPING_RATIO), stiffness)


def write_tap_test(folder: Path, name: str) -> None:
    """Write ten hits on a spindle as HDF5, and their FRF as UFF and CSV."""
    frequency, date = SPINDLES[name]
    hammering = Hammering(double_hits=0.0, overloads=0.0)
    signal = HammeredStructure(build_structure(frequency), TAP_RATE, np.random.default_rng(int(frequency)), hammering)
    source = SimulatedSource(signal, SENSORS, TAP_RATE, n_scans=round(20 * TAP_RATE))
    hits = tuple(islice(capture_hits(source, Trigger(20.0, SAMPLES, PRE_TRIGGER)), HITS))
    frf, flags = average_good_hits(hits)
    about = Circumstances("example", date, "reference", "x", "sim_data", MACHINE_TOML, "simulation")
    path = folder / f"tap-{name}-{frequency:.0f}-hz.h5"
    write_tap(path, TapTest(new_tap_id(about), about, frf, hits, flags))
    for suffix in (".uff", ".csv"):
        convert(path, path.with_suffix(suffix), Description())


def write_cuts(folder: Path) -> None:
    """Write a stable cut and one with chatter as WAV files: a slot at 12 000 rpm with four flutes in aluminium."""
    spindle = build_structure(SPINDLES["good"][0])
    modes = [*map(Mode, spindle.frequency, spindle.damping_ratio, spindle.stiffness)]
    slot = Cut(TEETH, 1.0, "down", tangential=700e6, radial=210e6)
    (limit,) = stability_boundary(modes, modes, slot, SPEED_RPM, 20e-3).depth
    for number, (name, ratio) in enumerate(DEPTHS.items()):
        random = np.random.default_rng(number)
        cut = MillingCut(
            TEETH,
            0.0,
            math.pi,
            slot.tangential,
            slot.radial,
            ratio * limit,
            5e-5,
            SPEED_RPM,
            spindle,
            spindle,
            runout=(5e-6, 0.0, -5e-6, 0.0),
        )
        passage = Passage(before=0.8, steady=1.2)
        housing = make_random_housing(random, SPEED_RPM)
        signal = HousingSignal(simulate_cut(cut, passage), housing, SPEED_RPM, SOUND_RATE, random)
        write_sound(folder / f"cut-{name}.wav", signal(0, round(2.4 * SOUND_RATE))[1])


def write_sound(path: Path, acceleration: NDArray[np.float64]) -> None:
    """Write acceleration (m/s^2) as a mono WAV file of 16 bits."""
    if np.max(np.abs(acceleration)) >= FULL_SCALE:
        raise ValueError(f"{path.name} clips at {FULL_SCALE:g} m/s^2. Raise FULL_SCALE.")
    codes = np.round(acceleration / FULL_SCALE * 32767).astype("<i2")
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, SOUND_RATE, 0, "NONE", ""))
        file.writeframes(codes.tobytes())


def main() -> None:
    """Write all files."""
    folder = Path(sys.argv[1]) if sys.argv[1:] else FOLDER
    for name in SPINDLES:
        write_tap_test(folder, name)
    write_cuts(folder)


if __name__ == "__main__":
    main()
