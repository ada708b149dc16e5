"""Outcome of human errors on random machines: what `tap`, `check` and `status` say, and honest series."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from emulated_workshop import Said, Workshop, ask
from human_errors import (
    Codes,
    acceleration_in_g,
    accelerometer_cable,
    accelerometer_entered_wrong,
    accelerometer_unit_wrong,
    amplifier_switched,
    clock_a_year_late,
    clock_ahead,
    clock_behind,
    copied_folder,
    directions_exchanged,
    exponential_window,
    force_unit_wrong,
    gain_at_once,
    gain_in_two_steps,
    gain_in_y_only,
    hammer_amplifier_switched,
    hammer_cable,
    hammer_entered_wrong,
    hammer_unit_wrong,
    harder_tip,
    longer_tool,
    mains_hum,
    microphonic_cable,
    old_test,
    other_point,
    other_sheet,
    other_sheet_later,
    rate_off,
    rate_off_slightly,
    sensor_falls,
    sensor_left,
    sensor_on_wax,
    sensor_upside_down,
    shorter_tool,
    soft_tip,
    speeds_with_thousands,
    spindle_starts,
    spindle_starts_slowly,
    spindle_turns,
    swap_channels,
    tools_mixed_up,
    unit_thousand,
    wrong_folder,
    wrong_mass,
    wrong_tool_name,
    y_of_another_tool,
)

from lobewatch.logbook import Logbook
from lobewatch.measurement.recording_questions import RECORDING_QUESTIONS

N_EARLIER = 6
"""Months with honest tests before an error."""


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
    said: Counter[str] = field(default_factory=Counter)
    """New codes, compared with the machine before the error."""


def codes(*names: str) -> Codes:
    return frozenset(names)


CHAIN = codes("chain-not-checked", "tool-compliance", "stiffness-off-model", "wrong-unit", "direction-stiffness")
TOOL = codes("mode-jump", "stiffness-jump", "frequency-jump", "no-mode-to-follow", "tool-compliance", "no-mode-in-band")
TURNING = codes("refused:spindle-turning", "hit:steady-vibration", "spindle-turning")
RATE_WRONG = codes("refused:rate", "rate-not-verified")
GAIN = codes("stiffness-jump", "wrong-unit", "wrong-quantity", "no-mode-in-band", "hit:too-soft", "hit:overload-force")
GAIN |= {"hit:too-hard", "hit:overload-response", "check:force sensor", "check:acceleration sensor", "hit:no-response"}
SETTING = codes("setting-not-plausible", "settings-contradict", "not-checked")
NO_RESPONSE = codes("hit:no-response", "check:acceleration sensor", "hit:missing-response")
LOOSE = codes("hit:inconsistent", "stiffness-jump", "tool-compliance", "mode-differs-over-hits", "no-mode-in-band")
BAND = codes("other-band", "no-mode-in-band", "no-mode-to-follow", "modes-incomplete", "hit:narrow-band")
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
    "sample rate off by 0.3 to 8 %": HumanError(rate_off, RATE_WRONG),
    "spindle turns from the start": HumanError(spindle_turns, TURNING),
    "spindle turns after the first hits": HumanError(spindle_starts, TURNING),
    "strong mains hum": HumanError(mains_hum, TURNING | {"check:hum"}),
    "cable of the accelerometer broken": HumanError(accelerometer_cable, NO_RESPONSE | TURNING),
    "cable of the hammer broken": HumanError(hammer_cable, codes("check:force sensor", "screen:unfelt-hit")),
    "accelerometer comes loose": HumanError(sensor_falls, NO_RESPONSE | LOOSE),
    "sensor left in x for y": HumanError(sensor_left, codes("same-direction")),
    "names x and y exchanged": HumanError(directions_exchanged, codes("exchanged-directions")),
    "shorter tool under the old name": HumanError(shorter_tool, TOOL),
    "longer tool under the old name": HumanError(longer_tool, TOOL),
    "another tool under the old name": HumanError(wrong_tool_name, TOOL),
    "same tool in another machine": HumanError(wrong_folder, TOOL),
    "newest test 7 to 16 months old": HumanError(old_test, codes("tap-old", "tap-too-old", "overdue")),
    "folder copied": HumanError(copied_folder, codes("folder-copied")),
    "soft tip": HumanError(soft_tip, BAND),
    "hits away from the tip": HumanError(other_point, codes("stiffness-jump", "tool-compliance")),
    "accelerometer on the other side": HumanError(sensor_upside_down, codes("no-mode-in-band", "sign")),
    "clock behind": HumanError(clock_behind, codes("clock-behind", "clock-before-release")),
    "clock ahead in one test": HumanError(clock_ahead, codes("clock-behind", "clock-ahead")),
    "exponential window not stated": HumanError(exponential_window, codes("damping-jump")),
    "spindle starts slowly after the first hits": HumanError(spindle_starts_slowly, TURNING),
    "sample rate off by 0.3 to 0.5 %": HumanError(rate_off_slightly, RATE_WRONG),
    "mm/s^2 or mN for m/s^2 or N": HumanError(unit_thousand, GAIN),
    "g for m/s^2": HumanError(acceleration_in_g, GAIN),
    "hammer amplifier switched by ten": HumanError(hammer_amplifier_switched, GAIN),
    "first tests, sheet of another sensor": HumanError(other_sheet, CHAIN, 0),
    "sensor of another sensitivity": HumanError(other_sheet_later, codes("stiffness-jump")),
    "gain changed between x and y": HumanError(gain_in_y_only, codes("stiffness-jump")),
    "tool changed between x and y": HumanError(y_of_another_tool, TOOL),
    "names of two tools exchanged": HumanError(tools_mixed_up, TOOL),
    "cable of the accelerometer swings": HumanError(microphonic_cable, NO_RESPONSE | {"hit:not-decayed"} | TURNING),
    "accelerometer on a soft mounting": HumanError(sensor_on_wax, TOOL | {"direction-stiffness"}),
    "another hammer tip": HumanError(harder_tip, BAND),
    "clock a year late": HumanError(clock_a_year_late, codes("clock-behind", "clock-before-release")),
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


class Machine:
    """Machine with honest tests, on copies of which errors are made."""

    def __init__(self, shop: Workshop, path: Path, number: int) -> None:
        """Ask about its last honest test."""
        self._shop, self._path, self._number = shop, path, number
        self.before = self._ask(self._copy("before"), frozenset())
        """Outcome without an error."""

    def _copy(self, name: str) -> Workshop:
        return self._shop.copy(self._path / f"{self._number}-{name}" / "m", self._number)

    def _ask(self, shop: Workshop, found: Codes) -> Seen:
        shop.write("just")
        return Seen(found, ask(shop, shop.time - timedelta(days=29)))

    def commit(self, name: str, error: HumanError) -> Seen:
        """Make an error, and ask a day after its last test. A refused test changes no answer, so nothing is asked."""
        shop = self._copy(str(list(ERRORS).index(name)))
        taps, toml = len(shop.folder.taps()), shop.folder.toml_text
        found = error.make(shop)
        is_refused = "refused" in found and len(shop.folder.taps()) == taps and shop.folder.toml_text == toml
        seen = Seen(found, self.before.said) if is_refused else self._ask(shop, found)
        shutil.rmtree(shop.path.parent)
        return seen


def measure(kinds: dict[str, HumanError], count: int, path: Path, *, first: int = 0) -> Iterator[tuple[str, Count]]:
    """Yield the kind and outcome of each error on each random machine, machine by machine."""
    earlier = sorted({error.earlier for error in kinds.values()})
    for number in range(first, first + count):
        for months in earlier:
            (shop,) = machines(1, path, months, first=number)
            machine = Machine(shop, path / f"{months}", number)
            for name, error in kinds.items():
                if error.earlier == months:
                    yield name, count_outcome(error, machine.commit(name, error), machine.before)


def count_outcome(error: HumanError, seen: Seen, before: Seen) -> Count:
    """Count one outcome."""
    is_silent = not seen.codes & error.right
    return Count(1, is_silent, seen.is_false, Counter(seen.codes - before.codes))


def count_questions(shop: Workshop, months: int = 24) -> int:
    """Return the number of questions in an honest series in x and y, each answered."""
    number = 0
    for _ in range(months):
        for direction in ("x", "y"):
            tapped = shop.tap(direction)
            asked = sorted(tapped.codes & set(RECORDING_QUESTIONS))
            number += len(asked) + (not tapped.tap_id)
            Logbook.open(shop.path).accept([tapped.tap_id], asked)
        shop.month += 1
    return number


def run_study(count: int, path: Path, results: Path, first: int = 0) -> None:
    """Write a JSON line for each error on each machine, and for an honest series after each second machine."""
    for number in range(first, first + count):
        for name, outcome in measure(ERRORS, 1, path, first=number):
            write_line(results, kind=name, machine=number, **vars(outcome))
        if number % 2:
            continue
        std = (0.03, 0.06)[number // 2 % 2]
        (shop,) = machines(1, path / "honest", 0, std, first=number)
        write_line(results, kind="honest series", machine=number, stiffness_std=std, questions=count_questions(shop))


def write_line(results: Path, **values: object) -> None:
    """Append a line of results."""
    with results.open("a", encoding="utf-8") as file:
        file.write(json.dumps(values) + "\n")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        run_study(int(sys.argv[1]), Path(folder), Path(sys.argv[2]), int(sys.argv[3]))
