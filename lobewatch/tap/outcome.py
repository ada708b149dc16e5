"""What a finished tap test means to the one who tapped: a light, the result in sentences, the next step."""

from __future__ import annotations

import math
from datetime import timedelta

import numpy as np

from dsm import plus_minus
from lobes import SldHistory
from lobewatch.analysis.advice import unstable_programs
from lobewatch.analysis.history import series
from lobewatch.analysis.pipeline import Measurement
from lobewatch.machine.machine_file import Machine
from lobewatch.tap.state import Outcome
from modal import Mode

ORDER = ("good", "warn", "alarm")


def outcome_of(found: Measurement, history: SldHistory, machine: Machine) -> Outcome:
    """Against the first measurement of the same tool and direction, the limits of machine.toml and its programs."""
    mode = found.dynamics.followed
    if mode is None:
        return Outcome("warn", list(found.reasons), "Tap again: the mode that is followed was not found in this test.")
    fall, error = _fall(found, mode, history) or (0.0, None)
    limits = machine.limits
    light = ORDER[(fall >= limits.frequency_warn_percent) + (fall >= limits.frequency_alarm_percent)]
    frequency = f"f_n {plus_minus(mode.frequency, float(mode.standard_error[0]))} Hz"
    against = "the first test of this tool and direction"
    if error is not None:
        against = f"{'+' if fall < 0 else ''}{plus_minus(-fall, error)} % against the first test"
    stiffness = plus_minus(mode.stiffness, float(mode.standard_error[2]), 1e6)
    damping = plus_minus(100 * mode.damping_ratio, 100 * float(mode.standard_error[1]))
    texts = [f"{frequency}, {against}.", f"K {stiffness} N/um, zeta {damping} %."]
    unstable = unstable_programs(found, machine)
    if unstable:
        texts.append(f"Not stable: {', '.join(unstable)}.")
        light = max(light, "warn", key=ORDER.index)
    return Outcome(light, texts, _next_step(found, machine, light, bool(unstable)))


def _fall(found: Measurement, mode: Mode, history: SldHistory) -> tuple[float, float] | None:
    """Of the frequency since the first measurement of this tool and direction, and its standard error (%).

    None where this is the first.
    """
    columns = history.columns
    rows = [row for row in series(history, found.tool, found.direction) if np.isfinite(columns["frequency"][row])]
    if not rows or columns["tap_id"][rows[0]] == found.tap_id:
        return None
    first, first_error = (float(columns[name][rows[0]]) for name in ("frequency", "frequency_std"))
    share = mode.frequency / first
    error = math.hypot(first_error / first, float(mode.standard_error[0]) / mode.frequency)
    return 100 * (1 - share), 100 * share * error


def _next_step(found: Measurement, machine: Machine, light: str, unstable: bool) -> str:
    if light == "alarm":
        return "Do not cut on: have the bearings, the tool and its clamping looked at, then tap again."
    if unstable:
        return "Change these programs before the next part: lobewatch check names a stable speed and depth for each."
    if light == "warn":
        return "Tap again to be sure; if it stays, have the bearings and the tool's clamping looked at soon."
    if found.x is None or found.y is None:
        other = "y" if found.direction == "x" else "x"
        return f"Tap direction {other} of the same tool within a day: the lobes are of one direction alone."
    due = found.time + timedelta(days=math.floor(machine.machine.tap_interval_days))
    return f"All is well: tap again by {due:%Y-%m-%d}."
