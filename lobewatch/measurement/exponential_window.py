"""Exponential windows on responses: correct, apply and detect them.

record ends; modes without them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from acquisition import (
    Frf,
    Hit,
    Remark,
    apply_exponential_window,
    correct_windowed_receptance,
    estimate_frf,
    find_hit_time,
    infer_window,
    measure_time_after_hit,
    remove_sensor_mass,
)
from modal import Mode, Trust, assess_trust, common_decay_rate, fit_modes, remove_window, widen_for_window

TIME_CONSTANT_TOLERANCE = 0.02
"""Relative difference of two time constants that are taken for one; chosen."""
WINDOW_END_LEVEL = 0.005
"""Share of the ringing that our window lets through at the end of the record; chosen."""
MAX_RESIDUAL_RINGING = 0.005
"""Share of the decay of a mode at the end of the record from which it is taken from the windowed hits; chosen."""


@dataclass(frozen=True)
class Window:
    """exp(-(t - start)/time_constant) from its start on; ValueError for a time constant that is not > 0.

    >>> Window(time_constant=0.1, start=0.0, hit_at=0.02).delay([])  # s from its start to the hit
    0.02
    """

    time_constant: float
    """Time constant of its fall (s); NaN: as the file names it."""
    start: float = 0.0
    """Time of its beginning (s from the record's start)."""
    hit_at: float | None = None
    """Time of the hit (s from the record's start); None to see it in the hits."""

    def __post_init__(self) -> None:
        """Refuse what is no window."""
        if not np.isnan(self.time_constant) and not (np.isfinite(self.time_constant) and self.time_constant > 0):
            raise ValueError(f"Window.time_constant: time_constant={self.time_constant} s is not a finite number > 0")

    @classmethod
    def from_options(cls, time_constant: float | None, start: float, hit_at: float | None) -> Self | None:
        """The window that a person names, without a time constant as the file names it; None where nothing is said."""
        if time_constant is None and hit_at is None and start == 0:
            return None
        return cls(float("nan") if time_constant is None else time_constant, start, hit_at)

    def delay(self, hits: Sequence[Hit]) -> float:
        """Time from its start to the hit (s); ValueError where the hit is not known or comes before it."""
        if self.hit_at is None and not hits:
            raise ValueError(
                f"Window.time_constant {self.time_constant:g}: an FRF does not say when the hit came, and K is too high by "
                "exp((hit - start)/window); add Window.hit_at with the seconds from the record's start (the "
                "pre-trigger), 0 where the window begins at the hit"
            )
        hit_at = float(np.mean([find_hit_time(hit) for hit in hits])) if self.hit_at is None else self.hit_at
        if not hit_at >= self.start:
            raise ValueError(
                f"Window.start {self.start:g}: the window begins after the hit at {hit_at:.4g} s; "
                "both count from the record's start"
            )
        return hit_at - self.start


def resolve_window(named: float | None, given: Window | None) -> Window | None:
    """The window to be corrected; named: time constant (s) in the file, NaN where it does not say how its window falls.

    ValueError where neither says it, or both do and differ.
    """
    if named is None and given is not None and np.isnan(given.time_constant):
        cure = "add Window.time_constant with its time constant (s)"
        raise ValueError(f"Window.hit_at, Window.start: the file names no window; {cure}")
    if named is None:
        return given
    window = Window(named) if given is None else given
    if np.isnan(window.time_constant):
        window = replace(window, time_constant=named)
    if np.isnan(window.time_constant):
        raise ValueError(
            "the response lies under a window, and the file does not say how that falls; give the time constant of an "
            "exponential one with Window.time_constant, export the file anew where it is another"
        )
    if abs(window.time_constant / named - 1) > TIME_CONSTANT_TOLERANCE:
        raise ValueError(
            f"Window.time_constant {window.time_constant:g}: the file says {named:.4g} s; leave the option out"
        )
    return window


def missing_window_text(named: float | None, given: Window | None) -> str:
    """What is going to be asked of the window over a file that lacks other things, too; empty where nothing is."""
    if (named is None and given is None) or (given is not None and given.hit_at is not None):
        return ""
    is_unknown = given is None and named is not None and np.isnan(named)
    needed = f"{'Window.time_constant with its time constant and ' if is_unknown else ''}Window.hit_at, too"
    return f"; its response lies under a window: an FRF needs {needed}, with the s from the record's start"


def window_ringing_hits(hits: Sequence[Hit]) -> tuple[Frf, tuple[Hit, ...], float]:
    """FRF of hits under a window that lets next to nothing of their ringing through, the hits, its time constant (s).

    What is left when the record ends stands in the FRF as if it had been cut off: K is off by about that share.
    """
    tau = min(measure_time_after_hit(hit) for hit in hits) / -float(np.log(WINDOW_END_LEVEL))
    windowed = tuple(apply_exponential_window(hit, tau) for hit in hits)
    return correct_windowed_receptance(estimate_frf(windowed), tau), windowed, tau


def own_window_remark(about: str, time_constant: float, cure: str) -> Remark:
    """Remark on what was done to a mode, or to all (about nothing)."""
    text = f"rings on when the record ends: fitted under an exponential window of {time_constant:.3g} s, corrected"
    return Remark("windowed-here", about, text if about else f"every hit {text}", cure)


def remove_own_window(modes: Sequence[Mode], time_constant: float) -> Iterator[Mode]:
    """Modes without that window; one that decays no faster than it is no mode."""
    for mode in modes:
        if 2 * np.pi * mode.damping_ratio * mode.frequency > 1 / time_constant:
            wider = widen_for_window(mode, time_constant, -time_constant * float(np.log(WINDOW_END_LEVEL)))
            yield remove_window(wider, time_constant)


def remove_recorded_window(
    modes: Sequence[Mode], time_constant: float, delay: float, record: float
) -> tuple[tuple[Mode, ...], tuple[Remark, ...]]:
    """Modes of a record (s) without the window that it was recorded with, and a remark on each that has no mode then.

    What decays no faster than the window is no mode behind it. Raises ValueError where that holds for all of them:
    then the time constant is wrong.
    """
    rings = [2 * np.pi * mode.damping_ratio * mode.frequency > 1 / time_constant for mode in modes]
    kept = [mode for mode, is_mode in zip(modes, rings, strict=True) if is_mode or not any(rings)]
    wider = (widen_for_window(mode, time_constant, record) for mode in kept)
    remarks = tuple(
        _slow_decay_remark(mode, time_constant) for mode, is_mode in zip(modes, rings, strict=True) if not is_mode
    )
    return tuple(remove_window(mode, time_constant, delay) for mode in wider), remarks


def _slow_decay_remark(mode: Mode, time_constant: float) -> Remark:
    text = f"decays no faster than the window of {time_constant:.3g} s: no mode behind it, left out"
    return Remark(
        "slower-than-window", f"{mode.frequency:.0f} Hz", text, "a wrong Window.time_constant does that to all modes"
    )


def refit_ringing_modes(
    modes: Sequence[Mode], hits: Sequence[Hit], band: tuple[float, float] | None, mass: float
) -> tuple[tuple[Mode, ...], tuple[Remark, ...]]:
    """Modes, those that still ring when the record ends taken from the hits under a window, and a remark on each.

    mass: of the sensor, which is taken off (kg). Modes that a person chose stay as they are.
    """
    if not hits or not any(_is_ringing(mode) for mode in modes):
        return tuple(modes), ()
    frf, windowed, tau = window_ringing_hits(hits)
    refitted = list(remove_own_window(fit_modes(remove_sensor_mass(frf, mass), band, windowed), tau))
    best, remarks = list[Mode](), list[Remark]()
    for mode in modes:
        same = _find_same_mode(mode, refitted) if _is_ringing(mode) else None
        best.append(mode if same is None else same)
        if same is not None:
            remarks.append(own_window_remark(f"{same.frequency:.0f} Hz", tau, "a longer record needs none"))
    return tuple(best), tuple(remarks)


def _is_ringing(mode: Mode) -> bool:
    chosen = any(remark.code == "by-hand" for remark in mode.remarks)
    return mode.remaining_decay is not None and mode.remaining_decay > MAX_RESIDUAL_RINGING and not chosen


def _find_same_mode(mode: Mode, candidates: Sequence[Mode]) -> Mode | None:
    """The nearest candidate within a half-power half-width."""

    def distance(candidate: Mode) -> float:
        return abs(candidate.frequency - mode.frequency)

    near = [candidate for candidate in candidates if distance(candidate) < mode.damping_ratio * mode.frequency]
    return min(near, key=distance, default=None)


def hidden_window_remarks(hits: Sequence[Hit], modes: Sequence[Mode]) -> Iterator[Remark]:
    """Remark on an exponential window that nobody named: the hits show it, or without any the modes, all of which then
    decay alike."""
    trusted = [mode for mode in modes if assess_trust(mode) is Trust.TRUSTED]
    if hits:
        tau, sign = infer_window(hits), "the noise at the end of the records is lower than before the hits"
    else:
        rate, sign = common_decay_rate(trusted), "all modes decay alike, damping falls as 1/f"
        tau = None if rate is None else 1 / rate
    if tau is not None:
        lost = "damping is too large, and stiffness by what it had lost by the hit"
        text = f"{sign}, as under an exponential window of {tau:.2g} s: {lost}"
        yield Remark("window-suspected", "", text, "look it up, and name it with --window, or export without")
