"""Cost of wrong assumptions: true limit over stated limit, both by semi-discretization.

`python bench/bench_assumptions.py` prints a line each for docs/studies/lobes.md. The spindle is that of the simulation
in the time domain: x 1500 Hz, 3 %, 20 N/um; y 1575 Hz, 2.8 %, 22 N/um; four teeth, Kt 800, Kr 240 N/mm2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, PitchPattern, project_modes, spectral_radius, stability_boundary, with_pitch_pattern
from modal import Mode

X, Y = [Mode(1500.0, 0.03, 20e6)], [Mode(1575.0, 0.028, 22e6)]
SPEEDS = np.linspace(3000, 16000, 14)
SLOT = Cut(4, 1.0, "down", 800e6, 240e6)
DEEPEST = 0.1
"""Limits beyond it (m) are none."""
DIAMETER = 16e-3
RANDOM = 120
"""Number of random spindles."""
PROCESS_DAMPING = 1e5
"""Force over depth and velocity of the tip, times cutting speed (N/m); assumed, as in the simulation."""

Floats = NDArray[np.float64]


def limits(cut: Cut, x: list[Mode] = X, y: list[Mode] = Y, speeds: Floats = SPEEDS) -> Floats:
    return stability_boundary(x, y, cut, speeds, DEEPEST).depth


def ratios() -> Iterator[tuple[str, Floats]]:
    """Name and true limit over the stated one, at each speed or of each random case."""
    quarter, narrow = replace(SLOT, immersion=0.25), replace(SLOT, immersion=0.05)
    slot = limits(SLOT)
    yield "modes askew, taken as along x and y", np.array(list(askew_ratios(np.random.default_rng(1))))
    yield "corner: a/D 0.25 becomes 0.75", limits(replace(SLOT, immersion=0.75)) / limits(quarter)
    for wear in (1.3, 1.6):
        worn = replace(SLOT, tangential=wear * SLOT.tangential, radial=wear * SLOT.radial)
        yield f"wear: Kt and Kr x {wear}", limits(worn) / slot
    helical = replace(narrow, helix_lag=2 * math.tan(math.radians(30)) / DIAMETER)
    with np.errstate(invalid="ignore"):
        yield "helix of 30 degrees not written, a/D 0.05", limits(helical) / limits(narrow)
    yield "feed between the axes, a/D 0.5 to 1", np.array(list(feed_ratios(np.random.default_rng(2))))
    for angles, cut in (((85, 95), SLOT), ((85, 95), quarter), ((80, 100), SLOT)):
        pattern = PitchPattern((*angles, *angles), "alternating")
        yield (
            f"pitch {angles} not written, a/D {cut.immersion:g}",
            limits(with_pitch_pattern(cut, pattern)) / limits(cut),
        )
    wall = Mode(600.0, 0.02, 5e6)
    yield "thin wall of 600 Hz, 5 N/um, 2 % in y, slot", limits(SLOT, y=[*Y, wall]) / slot
    rounded = replace(SLOT, radial=SLOT.radial * math.sin(math.radians(45)))
    yield "edge at 45 degrees (nose radius, round insert), slot", limits(rounded) / slot
    for first, last in ((20, 40), (40, 60)):
        yield f"process damping, lobes {first} to {last}, slot", np.array(list(damped_ratios(first, last)))


def askew_ratios(rng: np.random.Generator) -> Iterator[float]:
    """Two modes square to each other, 5 to 85 degrees off and within 18 %, against the limit from direct taps only."""
    for _ in range(RANDOM):
        first, second, cut, speed = random_case(rng, rng.choice([0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.75, 1.0]))
        angle = math.radians(rng.uniform(5, 85))
        c, s = math.cos(angle), math.sin(angle)
        vectors, pair = np.array([[c, s], [-s, c]]), [*first, *second]
        shown = project_modes(pair, vectors)
        true = stability_boundary(pair, None, cut, speed, DEEPEST, vectors).depth[0]
        yield true / limits(cut, shown.x, shown.y, speed)[0]


def random_case(rng: np.random.Generator, immersion: float) -> tuple[list[Mode], list[Mode], Cut, Floats]:
    """A mode in each of two directions, within 18 % of each other, and a cut fed along the first at a speed (rpm)."""
    frequency, stiffness = rng.uniform(600, 2200), 10 ** rng.uniform(6.9, 7.7)
    first = Mode(frequency, rng.uniform(0.015, 0.045), stiffness)
    higher = frequency * (1 + rng.uniform(0, 0.18))
    second = Mode(higher, rng.uniform(0.015, 0.045), stiffness * rng.uniform(0.75, 1.35))
    teeth, tangential = int(rng.integers(2, 6)), rng.uniform(600e6, 2000e6)
    cut = Cut(teeth, immersion, rng.choice(["up", "down"]).item(), tangential, tangential * rng.uniform(0.1, 0.6))
    return [first], [second], cut, np.array([60 * frequency / teeth / rng.uniform(0.5, 7)])


def feed_ratios(rng: np.random.Generator) -> Iterator[float]:
    """The worst angle every 15 degrees over the worse axis."""
    for _ in range(RANDOM):
        x, y, cut, speed = random_case(rng, rng.choice([0.5, 0.75, 1.0]))
        angles = [limits(replace(cut, feed_angle=i * math.pi / 12), x, y, speed)[0] for i in range(12)]
        yield min(angles) / min(angles[0], angles[6])


def damped_ratios(first: int, last: int) -> Iterator[float]:
    """With the force that rubbing flanks oppose to the velocity of the tip, in the mean over the teeth of a slot."""
    cut = replace(SLOT, tangential=2000e6, radial=800e6)
    for lobe in np.linspace(first, last, 5) + 0.5:
        speed = np.array([60 * X[0].frequency / (cut.teeth * lobe)])
        undamped, velocity = limits(cut, speeds=speed)[0], math.pi * DIAMETER * speed[0] / 60
        depth = undamped
        while depth < 6 * undamped:
            damping = PROCESS_DAMPING * depth / velocity
            x, y = ([_damped(mode, damping) for mode in side] for side in (X, Y))
            if spectral_radius(x, y, cut, speed, [depth])[0, 0] >= 1:
                break
            depth *= 1.02
        yield depth / undamped


def _damped(mode: Mode, damping: float) -> Mode:
    """With a parallel damper (Ns/m)."""
    added = damping * 2 * math.pi * mode.frequency / (2 * mode.stiffness)
    return replace(mode, damping_ratio=mode.damping_ratio + added)


def main() -> None:
    print("| assumption | min / median / max | below 0.9 |")
    for name, ratio in ratios():
        finite = ratio[np.isfinite(ratio) & (ratio > 0)]  # both have a limit
        low, middle, high = np.min(finite), np.median(finite), np.max(finite)
        print(
            f"| {name} | {low:.2f} / {middle:.2f} / {high:.2f} | {np.mean(finite < 0.9):.0%} of {finite.size} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
