"""Human errors on random machines, from the bytes of an emulated board to what `check` and `status` say."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from emulated_workshop import (
    Array,
    Disturbance,
    Said,
    Workshop,
    Wrong,
    ask,
    random_truth,
    resting_rms,
    scale,
    spread,
)

from acquisition import Structure
from lobewatch.fleet.fleet import Fleet, find_machines
from lobewatch.logbook import Logbook
from lobewatch.measurement.recording_questions import RECORDING_QUESTIONS

N_EARLIER = 6
"""Months with honest tests before an error."""
Codes = frozenset[str]
Rng = np.random.Generator


class Seen(NamedTuple):
    """Outcome of one error on one machine."""

    tap: Codes
    """Codes of the tap tests with the error, or why they were refused."""
    said: Said
    """Outputs of `check` and `status` after it."""

    @property
    def codes(self) -> Codes:
        """All codes."""
        return self.tap | self.said.check | self.said.status

    @property
    def is_false(self) -> bool:
        """True if a program that chatters is called stable."""
        return any(share > 1 for share in self.said.stable)


@dataclass(frozen=True)
class HumanError:
    """Kind of human error."""

    make: Callable[[Workshop], Codes]
    """Function that makes it on a machine, and returns the codes of its tap tests."""
    right: Codes
    """Codes that name the right cause."""
    earlier: int = N_EARLIER
    """Months with honest tests before it, 0 for an error in the first tests."""
    asks_programs: bool = False
    """True if only the verdict on a program can show it."""


@dataclass
class Count:
    """Outcome of one kind on some machines."""

    machines: int = 0
    silent: int = 0
    """Machines without a code that names the right cause."""
    false_stable: int = 0
    """Machines with `stable` for a cut that chatters."""
    silent_and_false: int = 0
    """Machines with both."""
    said: Counter[str] = field(default_factory=Counter)
    """New codes, compared with the machine before the error."""


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
    return shop.tap_both(Wrong(disturb=tone(shop, rpm / 60, rms, begin=2.5)))


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


def codes(*names: str) -> Codes:
    return frozenset(names)


CHAIN = codes("chain-not-checked", "tool-compliance", "stiffness-off-model", "wrong-unit", "direction-stiffness")
TOOL = codes("stiffness-jump", "frequency-jump", "no-mode-to-follow", "tool-compliance", "no-mode-in-band")
TURNING = codes("refused:spindle-turning", "hit:steady-vibration")
SETTING = codes("setting-not-plausible", "settings-contradict", "not-checked")
NO_RESPONSE = codes("hit:no-response", "check:acceleration sensor", "hit:missing-response")
LOOSE = codes("hit:inconsistent", "stiffness-jump", "tool-compliance")
ERRORS = {
    "gain changed at once": HumanError(gain_at_once, codes("stiffness-jump")),
    "amplifier switched by ten": HumanError(amplifier_switched, codes("stiffness-jump")),
    "gain changed in two steps": HumanError(gain_in_two_steps, codes("stiffness-jump")),
    "first tests, accelerometer 2.5 to 4 times wrong": HumanError(accelerometer_entered_wrong, CHAIN, 0),
    "first tests, hammer 2.5 to 4 times wrong": HumanError(hammer_entered_wrong, CHAIN, 0),
    "first tests, mV/g entered as mV/(m/s^2)": HumanError(accelerometer_unit_wrong, CHAIN, 0),
    "first tests, mV/lbf entered as mV/N": HumanError(hammer_unit_wrong, CHAIN, 0),
    "mass check with a wrong mass": HumanError(wrong_mass, codes("chain-not-checked")),
    "channels swapped": HumanError(swap_channels, codes("hit:swapped-channels")),
    "sample rate off by 0.3 to 8 %": HumanError(rate_off, codes("refused:rate", "rate-not-verified")),
    "spindle turns from the start": HumanError(spindle_turns, TURNING),
    "spindle turns after the first hits": HumanError(spindle_starts, TURNING),
    "strong mains hum": HumanError(mains_hum, TURNING | {"check:hum"}),
    "cable of the accelerometer broken": HumanError(accelerometer_cable, NO_RESPONSE | TURNING),
    "cable of the hammer broken": HumanError(hammer_cable, codes("check:force sensor", "screen:unfelt-hit")),
    "accelerometer comes loose": HumanError(
        sensor_falls, NO_RESPONSE | {"hit:inconsistent", "stiffness-jump", "tool-compliance"}
    ),
    "sensor left in x for y": HumanError(sensor_left, codes("same-direction")),
    "names x and y exchanged": HumanError(directions_exchanged, TOOL),
    "shorter tool under the old name": HumanError(shorter_tool, TOOL),
    "longer tool under the old name": HumanError(longer_tool, TOOL),
    "another tool under the old name": HumanError(wrong_tool_name, TOOL),
    "same tool in another machine": HumanError(wrong_folder, TOOL),
    "newest test 7 to 16 months old": HumanError(old_test, codes("tap-old", "tap-too-old", "overdue")),
    "folder copied": HumanError(copied_folder, codes("folder-copied")),
    "soft tip": HumanError(soft_tip, codes("other-band", "no-mode-in-band", "no-mode-to-follow", "modes-incomplete")),
    "hits away from the tip": HumanError(other_point, codes("stiffness-jump", "tool-compliance")),
    "accelerometer on the other side": HumanError(sensor_upside_down, codes("no-mode-in-band", "sign")),
    "clock behind": HumanError(clock_behind, codes("clock-behind", "clock-before-release")),
    "clock ahead in one test": HumanError(clock_ahead, codes("clock-behind", "clock-ahead")),
    "exponential window not stated": HumanError(exponential_window, codes("damping-jump")),
    "Kt and Kr in another unit": HumanError(force_unit_wrong, SETTING, asks_programs=True),
    "speeds with separators of thousands": HumanError(speeds_with_thousands, codes("right", "refused"), 0),
}
"""Kinds of human errors."""


def machines(
    count: int, path: Path, earlier: int, stiffness_std: float = 0.03, *, first: int = 0
) -> Iterator[Workshop]:
    """Yield random machines with honest tests, from a number on.

    Half of them know their tool. Half of those with tests have a mass check, so that a quarter has both.
    """
    for number, rng in list(enumerate(np.random.default_rng(52).spawn(first + count)))[first:]:
        shop = Workshop(path / f"{earlier}-{number}" / "m", rng, stiffness_std, knows_tool=number % 4 < 2)
        if earlier and number % 2:
            shop.check_mass()
        for _ in range(earlier):
            shop.tap_both()
        yield shop


def commit(error: HumanError, shop: Workshop, path: Path, seed: int) -> Seen:
    """Make an error on a copy of a machine, and ask a day after its last test."""
    other = shop.copy(path / "m", seed)
    found = error.make(other)
    other.write("just")
    return Seen(found, ask(other, other.time - timedelta(days=29)))


def measure(kinds: dict[str, HumanError], count: int, path: Path) -> dict[str, Count]:
    """Return the outcome of kinds of errors on random machines."""
    counts = {name: Count() for name in kinds}
    for earlier in {error.earlier for error in kinds.values()}:
        for number, shop in enumerate(machines(count, path, earlier)):
            before = commit(HumanError(Workshop.tap_both, codes()), shop, path / f"{earlier}-{number}-none", number)
            for place, (name, error) in enumerate(kinds.items()):
                if error.earlier == earlier:
                    seen = commit(error, shop, path / f"{earlier}-{number}-{place}", 1000 * number + place)
                    add(counts[name], error, seen, before)
    return counts


def add(count: Count, error: HumanError, seen: Seen, before: Seen) -> None:
    """Count one outcome."""
    is_silent = not seen.codes & error.right
    count.machines += 1
    count.silent += is_silent
    count.false_stable += seen.is_false
    count.silent_and_false += is_silent and seen.is_false
    count.said.update(seen.codes - before.codes)


def count_questions(count: int, stiffness_std: float, path: Path) -> list[int]:
    """Return the number of questions in each honest series of 24 months in x and y, each answered."""
    numbers = []
    for shop in machines(count, path, 0, stiffness_std):
        numbers.append(0)
        for _ in range(24):
            for direction in ("x", "y"):
                tapped = shop.tap(direction)
                asked = sorted(tapped.codes & set(RECORDING_QUESTIONS))
                numbers[-1] += len(asked) + (not tapped.tap_id)
                Logbook.open(shop.path).accept([tapped.tap_id], asked)
            shop.month += 1
    return numbers
