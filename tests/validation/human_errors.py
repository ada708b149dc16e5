"""Human errors on random machines, each made through the bytes of an emulated board."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import scipy
from emulated_board import (
    RATE,
    RIGHT,
    Array,
    Disturbance,
    Wrong,
    peak_response,
    random_truth,
    resting_rms,
    scale,
    spread,
)
from emulated_workshop import Workshop

from acquisition import Structure
from lobewatch.fleet.fleet import Fleet, find_machines

Codes = frozenset[str]
Rng = np.random.Generator


def either(rng: Rng, ratio: float) -> float:
    """Return a ratio or its inverse."""
    return ratio if rng.random() < 0.5 else 1 / ratio


def gain_at_once(shop: Workshop) -> Codes:
    """Change the gain of the accelerometer by 1.2 to 3 or its inverse."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, spread(shop.rng, 1.2, 3.0)))))


def amplifier_switched(shop: Workshop) -> Codes:
    """Switch the amplifier by a factor of 10."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, 10.0))))


def gain_in_two_steps(shop: Workshop) -> Codes:
    """Change it in two tests."""
    ratio = either(shop.rng, spread(shop.rng, 1.3, 3.0))
    first = shop.tap_both(Wrong(gains=(1.0, math.sqrt(ratio))))
    return first | shop.tap_both(Wrong(gains=(1.0, ratio)))


def accelerometer_entered_wrong(shop: Workshop) -> Codes:
    """Enter its sensitivity wrong by a factor of 2.5 to 4."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, spread(shop.rng, 2.5, 4.0)))))


def hammer_entered_wrong(shop: Workshop) -> Codes:
    """Enter its sensitivity wrong by a factor of 2.5 to 4."""
    return shop.tap_both(Wrong(gains=(either(shop.rng, spread(shop.rng, 2.5, 4.0)), 1.0)))


def accelerometer_unit_wrong(shop: Workshop) -> Codes:
    """Enter mV/g as mV/(m/s^2), or the other way round."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, 9.80665))))


def hammer_unit_wrong(shop: Workshop) -> Codes:
    """Enter mV/lbf as mV/N, or the other way round."""
    return shop.tap_both(Wrong(gains=(either(shop.rng, 4.448), 1.0)))


def wrong_mass(shop: Workshop) -> Codes:
    """Weigh the block of the mass check wrong, after the tests."""
    shop.check_mass(entered=either(shop.rng, spread(shop.rng, 1.3, 3.0)))
    return frozenset()


def swap_channels(shop: Workshop) -> Codes:
    """Swap the cables of hammer and accelerometer."""
    ratio = shop.channels[1].sensitivity / shop.channels[0].sensitivity
    return shop.tap_both(Wrong(disturb=lambda signals, _: np.stack([signals[1] * ratio, signals[0] / ratio])))


def rate_off(shop: Workshop) -> Codes:
    """Sample at another rate than the one once measured, by 0.3 to 8 %."""
    shop.know_rate()
    found = shop.tap("x", Wrong(rate_ratio=1 + spread(shop.rng, 0.003, 0.08) * shop.rng.choice([-1, 1])))
    shop.month += 1
    return found.codes


def tone(shop: Workshop, frequency: float, rms: float, begin: float = 0.0, row: int = 1) -> Disturbance:
    """Return the disturbance by a tone with its second and third harmonic."""
    shares, phases = np.array([1.0, 0.3, 0.15]), shop.rng.uniform(0, 2 * math.pi, 3)

    def disturb(signals: Array, seconds: Array) -> Array:
        waves = np.sin(2 * np.pi * frequency * np.outer([1, 2, 3], seconds) + phases[:, np.newaxis])
        signals = signals.copy()
        signals[row] += math.sqrt(2) * rms * (shares @ waves) * (seconds >= begin)
        return signals

    return disturb


def spindle_turns(shop: Workshop) -> Codes:
    """Tap a spindle that turns from the start."""
    rpm, rms = spread(shop.rng, 600, 24000), resting_rms(shop) * spread(shop.rng, 2, 40)
    return shop.tap_both(Wrong(disturb=tone(shop, rpm / 60, rms)))


def spindle_starts(shop: Workshop) -> Codes:
    """Tap a spindle that begins to turn after the first hits."""
    rpm, rms = spread(shop.rng, 600, 24000), resting_rms(shop) * spread(shop.rng, 5, 40)
    return shop.tap_both(Wrong(disturb=tone(shop, rpm / 60, rms, begin=2.5), guided=True))


def mains_hum(shop: Workshop) -> Codes:
    """Tap with strong mains hum in the accelerometer."""
    rms = resting_rms(shop) * spread(shop.rng, 10, 100)
    return shop.tap_both(Wrong(disturb=tone(shop, shop.rng.choice([50, 60]), rms)))


def broken_cable(shop: Workshop, row: int, low: float, high: float) -> Codes:
    hum = tone(shop, shop.rng.choice([50, 60]), spread(shop.rng, low, high), row=row)

    def disturb(signals: Array, seconds: Array) -> Array:
        noise = shop.rng.standard_normal(seconds.size) * low / 10
        return hum(np.where(np.arange(2)[:, np.newaxis] == row, noise, signals), seconds)

    return shop.tap_both(Wrong(disturb=disturb), only=["x"])


def accelerometer_cable(shop: Workshop) -> Codes:
    """Break the cable of the accelerometer: hum or nearly nothing."""
    return broken_cable(shop, 1, 0.2, 50)


def hammer_cable(shop: Workshop) -> Codes:
    """Break the cable of the hammer: hum or nearly nothing."""
    return broken_cable(shop, 0, 0.05, 5)


def sensor_falls(shop: Workshop) -> Codes:
    """Let the accelerometer come loose during the test: a part of the signal is left."""
    begin, left = shop.rng.uniform(2, 4), shop.rng.choice([0.0, 0.1, 0.5])

    def disturb(signals: Array, seconds: Array) -> Array:
        return signals * np.where(np.outer([0, 1], seconds > begin), left, 1.0)

    return shop.tap_both(Wrong(disturb=disturb), only=["x"])


def sensor_left(shop: Workshop) -> Codes:
    """Measure y with sensor and hammer left in x."""
    return tap_structures(shop, shop.truth.x, shop.truth.x)


def directions_exchanged(shop: Workshop) -> Codes:
    """Exchange the names x and y."""
    found = shop.tap("x", Wrong(structure=shop.truth.y)).codes | shop.tap("y", Wrong(structure=shop.truth.x)).codes
    shop.month += 1
    return found


def other_length(shop: Workshop, ratio: float) -> Codes:
    """Tap a tool of another length: its mode and compliance change, and a little of the other mode."""
    frequency, stiffness = np.array([ratio**-0.3, ratio**-1.7]), np.array([ratio**-0.6, ratio**-3])
    return tap_structures(shop, *(scale(shop.truth.of(name), frequency, stiffness) for name in "xy"))


def tap_structures(shop: Workshop, x: Structure, y: Structure) -> Codes:
    """Tap other structures under the old names."""
    found = shop.tap("x", Wrong(structure=x)).codes | shop.tap("y", Wrong(structure=y)).codes
    shop.month += 1
    return found


def shorter_tool(shop: Workshop) -> Codes:
    """Tap a tool that is 7 to 20 % shorter."""
    return other_length(shop, shop.rng.uniform(0.80, 0.93))


def longer_tool(shop: Workshop) -> Codes:
    """Tap a tool that is 7 to 20 % longer."""
    return other_length(shop, 1 / shop.rng.uniform(0.80, 0.93))


def wrong_tool_name(shop: Workshop) -> Codes:
    """Tap another tool under the old name."""
    other = random_truth(shop.rng)
    return tap_structures(shop, other.x, other.y)


def wrong_folder(shop: Workshop) -> Codes:
    """Tap the same tool in another machine: its spindle has another frequency and stiffness."""
    ratios = [spread(shop.rng, 1.1, 1.6) ** shop.rng.choice([-1, 1]) for _ in range(2)]
    low = np.array([ratios[0], 1.0]), np.array([ratios[1], 1.0])
    return tap_structures(shop, *(scale(shop.truth.of(name), *low) for name in "xy"))


def old_test(shop: Workshop) -> Codes:
    """Ask 7 to 16 months after the last test; half of the machines have an agreed interval."""
    shop.month += int(shop.rng.integers(7, 17))
    if shop.rng.random() < 0.5:
        shop.interval = 30
    return frozenset()


def copied_folder(shop: Workshop) -> Codes:
    """Copy the folder next to its original, and tap on in the original."""
    shutil.copytree(shop.path, shop.path.parent / "copy")
    found = shop.tap_both()
    machines = Fleet(find_machines(shop.path.parent)).assess_machines(shop.time)
    return found | {remark.code for machine in machines for remark in machine.current.remarks}


def soft_tip(shop: Workshop) -> Codes:
    """Leave a soft tip on the hammer: pulses of 2.5 to 5 ms."""
    return shop.tap_both(Wrong(width=spread(shop.rng, 2.5e-3, 5e-3)))


def other_point(shop: Workshop) -> Codes:
    """Hit away from the tip: less motion there, of the mode of the tool most."""
    share = np.array([shop.rng.uniform(0.8, 0.95), shop.rng.uniform(0.55, 0.85)])
    return tap_structures(shop, *(scale(shop.truth.of(name), 1.0, 1 / share) for name in "xy"))


def sensor_upside_down(shop: Workshop) -> Codes:
    """Glue the accelerometer to the other side."""
    return shop.tap_both(Wrong(gains=(1.0, -1.0)))


def clock_behind(shop: Workshop) -> Codes:
    """Let the clock of the computer be 100 to 900 days late."""
    late = timedelta(days=float(shop.rng.uniform(100, 900)))
    return shop.tap_both(Wrong(created=shop.time - late, guided=True), only=["x"])


def clock_ahead(shop: Workshop) -> Codes:
    """Let the clock be years ahead in one test, and right in the next."""
    ahead = datetime.now(UTC) + timedelta(days=float(shop.rng.uniform(100, 900)))
    shop.tap_both(Wrong(created=ahead), only=["x"])
    return shop.tap_both(Wrong(guided=True), only=["x"])


def exponential_window(shop: Workshop) -> Codes:
    """Leave the exponential window of the analyser on: damping of the window in the response."""
    time = spread(shop.rng, 0.02, 0.15)
    windowed = []
    for name in "xy":
        structure = shop.truth.of(name)
        windowed.append(
            replace(structure, damping_ratio=structure.damping_ratio + 1 / (2 * np.pi * structure.frequency * time))
        )
    return tap_structures(shop, *windowed)


def spindle_starts_slowly(shop: Workshop) -> Codes:
    """Tap a spindle that begins to turn at 600 to 1500 rpm after the first hits."""
    rpm, rms = spread(shop.rng, 600, 1500), resting_rms(shop) * spread(shop.rng, 5, 40)
    return shop.tap_both(Wrong(disturb=tone(shop, rpm / 60, rms, begin=2.5), guided=True))


def rate_off_slightly(shop: Workshop) -> Codes:
    """Sample at another rate than the one once measured, by 0.3 to 0.5 %."""
    shop.know_rate()
    found = shop.tap("x", Wrong(rate_ratio=1 + spread(shop.rng, 0.003, 0.005) * shop.rng.choice([-1, 1])))
    shop.month += 1
    return found.codes


def unit_thousand(shop: Workshop) -> Codes:
    """Read mm/s^2 as m/s^2, or mN as N, from one test to the next."""
    ratio = either(shop.rng, 1e3)
    return shop.tap_both(Wrong(gains=(ratio, 1.0) if shop.rng.random() < 0.5 else (1.0, ratio)))


def acceleration_in_g(shop: Workshop) -> Codes:
    """Read g as m/s^2 from one test to the next."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, 9.80665))))


def hammer_amplifier_switched(shop: Workshop) -> Codes:
    """Turn the gain of the hammer by a factor of 10."""
    return shop.tap_both(Wrong(gains=(either(shop.rng, 10.0), 1.0)))


def other_sheet(shop: Workshop) -> Codes:
    """Enter the calibration sheet of another sensor of the type in the first tests: 5 to 25 % off."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, spread(shop.rng, 1.05, 1.25)))))


def other_sheet_later(shop: Workshop) -> Codes:
    """Exchange the accelerometer for one of 15 to 40 % more or less, and keep the old sheet."""
    return shop.tap_both(Wrong(gains=(1.0, either(shop.rng, spread(shop.rng, 1.15, 1.4)))))


def gain_in_y_only(shop: Workshop) -> Codes:
    """Turn a gain by 1.4 to 5 between x and y."""
    found = shop.tap("x").codes | shop.tap("y", Wrong(gains=(1.0, either(shop.rng, spread(shop.rng, 1.4, 5))))).codes
    shop.month += 1
    return found


def y_of_another_tool(shop: Workshop) -> Codes:
    """Change the tool between x and y."""
    return tap_structures(shop, shop.truth.x, random_truth(shop.rng).x)


def tools_mixed_up(shop: Workshop) -> Codes:
    """Follow two tools for two months, then exchange their names."""
    other = random_truth(shop.rng)
    for _ in range(2):
        shop.tap("x", Wrong(structure=other.x, tool="other"))
        shop.tap("y", Wrong(structure=other.y, tool="other"))
        shop.tap_both()
    found = tap_structures(shop, other.x, other.y)
    return found | shop.tap("x", Wrong(structure=shop.truth.x, tool="other")).codes


def microphonic_cable(shop: Workshop) -> Codes:
    """Let the cable of the accelerometer swing: every hit adds a slow swing of 2 to 20 % of the response."""
    root = np.exp((-3.0 + 2j * np.pi * shop.rng.uniform(5, 30)) / RATE)
    size = spread(shop.rng, 0.02, 0.2) * peak_response(shop.truth.x) / (0.5 * RIGHT.width * RATE)
    state = np.zeros(1, complex)

    def disturb(signals: Array, _: Array) -> Array:
        nonlocal state
        moved, state = scipy.signal.lfilter([1.0], [1.0, -root], np.maximum(signals[0], 0.0), zi=state)
        return np.stack([signals[0], signals[1] + size * moved.real])

    return shop.tap_both(Wrong(disturb=disturb), only=["x"])


def sensor_on_wax(shop: Workshop) -> Codes:
    """Mount the accelerometer on something soft: a resonance at 1 to 3 times the mode of the tool."""
    contact = float(shop.rng.uniform(1.0, 3.0) * shop.truth.x.frequency[-1])
    soft = [with_mounting(shop.truth.of(name), contact) for name in "xy"]
    return tap_structures(shop, *soft)


def with_mounting(structure: Structure, contact: float) -> Structure:
    """Return a structure with its modes amplified by a mounting resonance (Hz), which is added as a weak mode."""
    gain = 1 / np.abs(1 - (structure.frequency / contact) ** 2 + 0.1j * structure.frequency / contact)
    return replace(structure, stiffness=structure.stiffness / gain)


def harder_tip(shop: Workshop) -> Codes:
    """Change to a harder or softer tip that still excites the modes: no error, but another band."""
    return shop.tap_both(Wrong(width=float(shop.rng.choice([0.35e-3, 1.1e-3]))))


def clock_a_year_late(shop: Workshop) -> Codes:
    """Let the clock of the computer be one year late."""
    return shop.tap_both(Wrong(created=shop.time - timedelta(days=365), guided=True), only=["x"])


def force_unit_wrong(shop: Workshop) -> Codes:
    """Enter Kt and Kr in kN/mm^2, kgf/mm^2, MPa times ten, or psi."""
    shop.ratio = float(shop.rng.choice([1e-3, 1 / 9.80665, 0.1, 145.0]))
    return frozenset()


def speeds_with_thousands(shop: Workshop) -> Codes:
    """Enter the speeds of a new machine with separators of thousands."""
    low, high = shop.rng.integers(1, 4) * 1000, shop.rng.integers(8, 40) * 500
    sign = str(shop.rng.choice([",", ".", "'", " "]))
    text = " ".join(f"{value:,}".replace(",", sign) for value in (int(low), int(high)))
    path = shop.path.parent / "new"
    command = [sys.executable, "-m", "lobewatch", "init", str(path), "--yes", "--speeds", text]
    if subprocess.run(command, capture_output=True, check=False).returncode == 2:
        return frozenset({"refused"})
    speed = tomllib.loads((path / "machine.toml").read_text("utf-8"))["speed"]
    return frozenset({"right"} if (speed["low_rpm"], speed["high_rpm"]) == (low, high) else ())
