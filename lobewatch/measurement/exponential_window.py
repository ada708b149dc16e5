"""Exponential windows on responses: correct, apply and detect them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

import acquisition
from acquisition import Frf, Hit, Remark
from modal import Mode, Trust, assess_trust, common_decay_rate, fit_modes, remove_window, widen_for_window

TIME_CONSTANT_TOLERANCE = 0.02
"""Relative difference up to which two time constants are the same; chosen."""
WINDOW_END_LEVEL = 0.005
"""Level of our own window at the end of the record; chosen."""
MAX_RESIDUAL_RINGING = 0.005
"""Level of a mode at the end of the record above which it is refitted under a window; chosen."""


@dataclass(frozen=True)
class Window:
    """Exponential window exp(-(t - start)/time_constant) from its start on.

    Raises ValueError for a time constant that is not above 0.

    >>> Window(time_constant=0.1, start=0.0, hit_at=0.02).delay([])  # s from its start to the hit
    0.02
    """

    time_constant: float
    """Time constant (s); NaN: that of the file."""
    start: float = 0.0
    """Start of the window (s from the start of the record)."""
    hit_at: float | None = None
    """Time of the hit (s from the start of the record); None: detected in the hits."""

    def __post_init__(self) -> None:
        if not np.isnan(self.time_constant) and not (np.isfinite(self.time_constant) and self.time_constant > 0):
            raise ValueError(f"Window.time_constant: time_constant={self.time_constant} s is not a finite number > 0")

    @classmethod
    def from_options(cls, time_constant: float | None, start: float, hit_at: float | None) -> Self | None:
        """Make the window of given values; None if nothing is given.

        Parameters
        ----------
        time_constant
            Time constant (s); None for that of the file.
        start
            Start of the window (s).
        hit_at
            Time of the hit (s); None if not given.
        """
        if time_constant is None and hit_at is None and start == 0:
            return None
        return cls(float("nan") if time_constant is None else time_constant, start, hit_at)

    def delay(self, hits: Sequence[Hit]) -> float:
        """Return the time from the start of the window to the hit (s).

        Parameters
        ----------
        hits
            Hits of the recording, for the time of the hit.

        Raises
        ------
        ValueError
            If the time of the hit is unknown or before the start.
        """
        if self.hit_at is None and not hits:
            cure = "Give that time (s from the start of the record) with Window.hit_at, or 0 if the window begins then."
            raise ValueError(f"Window.time_constant {self.time_constant:g}: the time of the hit is unknown. {cure}")
        times = [acquisition.find_hit_time(hit) for hit in hits] if self.hit_at is None else [self.hit_at]
        hit_at = float(np.mean(times))
        if not hit_at >= self.start:
            problem = f"the window begins after the hit at {hit_at:.4g} s (both times from the start of the record)"
            raise ValueError(f"Window.start {self.start:g}: {problem}. Correct Window.start or Window.hit_at.")
        return hit_at - self.start


def resolve_window(named: float | None, given: Window | None) -> Window | None:
    """Return the window to correct; named: time constant (s) in the file, NaN for an unknown shape.

    Raises ValueError if the time constant is unknown or contradicts the file.
    """
    if named is None and given is not None and np.isnan(given.time_constant):
        cure = "Give the time constant of the window (s) with Window.time_constant."
        raise ValueError(f"Window.hit_at, Window.start: the file declares no window. {cure}")
    if named is None:
        return given
    window = Window(named) if given is None else given
    if np.isnan(window.time_constant):
        window = replace(window, time_constant=named)
    if np.isnan(window.time_constant):
        cure = (
            "Give it with Window.time_constant if the window is exponential, or export the response without a window."
        )
        raise ValueError(f"the response has a window of unknown time constant. {cure}")
    if abs(window.time_constant / named - 1) > TIME_CONSTANT_TOLERANCE:
        option = f"Window.time_constant {window.time_constant:g}"
        raise ValueError(f"{option}: the file states {named:.4g} s. Leave out the time constant.")
    return window


def missing_window_text(named: float | None, given: Window | None) -> str:
    """Return the request for missing window data of a file that lacks other data too, else an empty text."""
    if (named is None and given is None) or (given is not None and given.hit_at is not None):
        return ""
    is_unknown = given is None and named is not None and np.isnan(named)
    needed = f"{'Window.time_constant (s) and ' if is_unknown else ''}Window.hit_at (s from the start of the record)"
    return f"The response has a window: give {needed} as well"


def window_ringing_hits(hits: Sequence[Hit], time_constant: float | None = None) -> tuple[Frf, tuple[Hit, ...], float]:
    """Return the FRF of hits under our own window, the windowed hits, and the time constant (s).

    time_constant (s): None for that of the shortest record. The rest of the ringing at the end of the record acts as if
    cut off: K is wrong by about that share.
    """
    shortest = min(acquisition.measure_time_after_hit(hit) for hit in hits) / -float(np.log(WINDOW_END_LEVEL))
    tau = shortest if time_constant is None else time_constant
    windowed = tuple(acquisition.apply_exponential_window(hit, tau) for hit in hits)
    return acquisition.correct_windowed_receptance(acquisition.estimate_frf(windowed), tau), windowed, tau


def own_window_remark(about: str, time_constant: float, cure: str) -> Remark:
    """Return the remark on our own window over a mode, or over all hits for an empty subject."""
    text = f"{'vibration' if about else 'every hit'} outlasts the record"
    text += f" (fitted with an exponential window of {time_constant:.3g} s, whose damping is removed)"
    return Remark("windowed-here", about, text, cure)


def remove_own_window(modes: Sequence[Mode], time_constant: float, delay: float = 0.0) -> Iterator[Mode]:
    """Yield modes without our own window; a mode that decays no faster than the window is none.

    delay: time from the start of the window to the hit (s).
    """
    for mode in modes:
        if 2 * np.pi * mode.damping_ratio * mode.frequency > 1 / time_constant:
            wider = widen_for_window(mode, time_constant, -time_constant * float(np.log(WINDOW_END_LEVEL)))
            yield remove_window(wider, time_constant, delay)


def remove_recorded_window(
    modes: Sequence[Mode], time_constant: float, delay: float, record: float
) -> tuple[tuple[Mode, ...], tuple[Remark, ...]]:
    """Remove the window of a record (s) from modes, and remark on those that it cannot contain.

    A mode that decays no faster than the window is none. Raises ValueError if that holds for all: then the time
    constant is wrong.
    """
    rings = [2 * np.pi * mode.damping_ratio * mode.frequency > 1 / time_constant for mode in modes]
    kept = [mode for mode, is_mode in zip(modes, rings, strict=True) if is_mode or not any(rings)]
    wider = (widen_for_window(mode, time_constant, record) for mode in kept)
    text = f"the peak is not a mode, because it decays no faster than the window of {time_constant:.3g} s"
    said = text, "Check Window.time_constant if all modes are affected"
    slow = [mode for mode, is_mode in zip(modes, rings, strict=True) if not is_mode]
    remarks = tuple(Remark("slower-than-window", f"{mode.frequency:.0f} Hz", *said) for mode in slow)
    return tuple(remove_window(mode, time_constant, delay) for mode in wider), remarks


def refit_ringing_modes(
    modes: Sequence[Mode], hits: Sequence[Hit], band: tuple[float, float] | None, mass: float
) -> tuple[tuple[Mode, ...], tuple[Remark, ...]]:
    """Replace modes that ring at the end of the record by fits under a window, with a remark on each.

    mass: sensor mass to remove (kg). Modes chosen by hand stay.
    """
    if not hits or not any(_is_ringing(mode) for mode in modes):
        return tuple(modes), ()
    frf, windowed, tau = window_ringing_hits(hits)
    refitted = list(remove_own_window(fit_modes(acquisition.remove_sensor_mass(frf, mass), band, windowed), tau))
    best, remarks = list[Mode](), list[Remark]()
    for mode in modes:
        same = _find_same_mode(mode, refitted) if _is_ringing(mode) else None
        best.append(same or mode)
        if same is not None:
            remarks.append(own_window_remark(f"{same.frequency:.0f} Hz", tau, "Record longer to avoid the window"))
    return tuple(best), tuple(remarks)


def _is_ringing(mode: Mode) -> bool:
    chosen = any(remark.code == "by-hand" for remark in mode.remarks)
    return mode.remaining_decay is not None and mode.remaining_decay > MAX_RESIDUAL_RINGING and not chosen


def _find_same_mode(mode: Mode, candidates: Sequence[Mode]) -> Mode | None:
    """Return the nearest candidate within a half-power half-width, or None."""
    nearest = min(candidates, key=lambda candidate: abs(candidate.frequency - mode.frequency), default=None)
    is_near = nearest and abs(nearest.frequency - mode.frequency) < mode.damping_ratio * mode.frequency
    return nearest if is_near else None


def hidden_window_remarks(hits: Sequence[Hit], modes: Sequence[Mode]) -> Iterator[Remark]:
    """Yield a remark on an undeclared exponential window, detected in the hits or else in equal decay rates."""
    trusted = [mode for mode in modes if assess_trust(mode) is Trust.TRUSTED]
    if hits:
        tau, sign = acquisition.infer_window(hits), "the noise is lower at the end of the records than before the hits"
    else:
        rate, sign = common_decay_rate(trusted), "all modes decay at the same rate"
        tau = None if rate is None else 1 / rate
    if tau is not None:
        text = f"{sign}, as with an exponential window of {tau:.2g} s: zeta and stiffness K read too high"
        cure = "Give the time constant with Window.time_constant, or export the response without a window"
        yield Remark("window-suspected", "", text, cure)
