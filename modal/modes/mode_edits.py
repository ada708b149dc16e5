"""Edits of the modes of an FRF by a person."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np


@dataclass(frozen=True)
class ModeEdits:
    """Modes to be added, dropped or fixed by hand.

    Raises
    ------
    ValueError
        For values that no mode has, or a frequency given twice.

    Examples
    --------
    >>> ModeEdits(add=(298.0,), fix=((1500.0, 0.03),))
    ModeEdits(add=(298.0,), drop=(), fix=((1500.0, 0.03),))
    >>> ModeEdits(fix=((1500.0, 1.5),))
    Traceback (most recent call last):
        ...
    ValueError: fix 1500:1.5: damping ratio 1.5 is not between 0 and 1. Give a damping ratio of 3 % as 0.03.
    """

    add: tuple[float, ...] = ()
    """Frequencies near which a further mode is fitted (Hz)."""
    drop: tuple[float, ...] = ()
    """Frequencies of modes to be left out (Hz)."""
    fix: tuple[tuple[float, float], ...] = ()
    """Natural frequencies (Hz) and damping ratios at which modes are held; their modal constants are fitted."""

    def __post_init__(self) -> None:
        """Check frequencies and damping ratios."""
        for name, (frequency, *_) in self._edits():
            if not (isfinite(frequency) and frequency > 0):
                raise ValueError(f"{name} {frequency:g}: the frequency is not above 0 Hz")
        for frequency, zeta in self.fix:
            if not 0 < zeta < 1:
                finding = f"fix {frequency:g}:{zeta:g}: damping ratio {zeta:g} is not between 0 and 1"
                raise ValueError(f"{finding}. Give a damping ratio of 3 % as 0.03.")
        named: dict[float, str] = {}
        for name, (frequency, *_) in self._edits():
            if frequency in named:
                both = f"{name} twice" if named[frequency] == name else f"{named[frequency]} and {name}"
                raise ValueError(f"{frequency:g} Hz: {both}. Give one edit per mode.")
            named[frequency] = name

    def _edits(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        yield from (("add", (frequency,)) for frequency in self.add)
        yield from (("drop", (frequency,)) for frequency in self.drop)
        yield from (("fix", held) for held in self.fix)

    def __bool__(self) -> bool:
        """Return whether there is any edit."""
        return bool(self.add or self.drop or self.fix)

    def __str__(self) -> str:
        """Return the edits as text: "add 298, drop 412, fix 1500:0.03"."""
        edits = ((name, ":".join(f"{value:.10g}" for value in values)) for name, values in self._edits())
        return ", ".join(map(" ".join, edits))

    def with_window(self, time_constant: float) -> "ModeEdits":
        """Return the edits for a response under an exponential window, which adds to the fixed damping.

        Parameters
        ----------
        time_constant : float
            Time constant of the window exp(-t/time_constant) (s).

        Returns
        -------
        ModeEdits
            Edits with larger damping ratios.
        """
        return ModeEdits(self.add, self.drop, tuple(_add_window_damping(*held, time_constant) for held in self.fix))


def _add_window_damping(frequency: float, zeta: float, time_constant: float) -> tuple[float, float]:
    """Add the damping of a window and keep the damped frequency."""
    size = 2 * np.pi * frequency
    decay = zeta * size + 1 / time_constant
    w = float(np.hypot(decay, size * np.sqrt(1 - zeta**2)))
    return w / (2 * np.pi), decay / w


def parse_mode_edits(
    add: Sequence[str] | None = None, drop: Sequence[str] | None = None, fix: Sequence[str] | None = None
) -> ModeEdits:
    """Parse edits of modes.

    Parameters
    ----------
    add, drop : sequence of str, optional
        Frequencies as in "298" (Hz).
    fix : sequence of str, optional
        Frequency and damping ratio as in "1500:0.03" (Hz and -).

    Returns
    -------
    ModeEdits
        Parsed edits.

    Raises
    ------
    ValueError
        For any other text.

    Examples
    --------
    >>> parse_mode_edits(add=["298"], fix=["1500:0.03"])
    ModeEdits(add=(298.0,), drop=(), fix=((1500.0, 0.03),))
    """
    pairs = [_numbers("fix", t, "frequency (Hz) and damping ratio, for example 1500:0.03", 2) for t in fix or ()]
    return ModeEdits(
        tuple(_numbers("add", text, "a frequency (Hz), for example 298.5", 1)[0] for text in add or ()),
        tuple(_numbers("drop", text, "a frequency (Hz), for example 412", 1)[0] for text in drop or ()),
        tuple((frequency, zeta) for frequency, zeta in pairs),
    )


def _numbers(name: str, text: str, wanted: str, count: int) -> list[float]:
    try:
        numbers = [float(word) for word in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        point = " with a decimal point" if "," in text else ""
        raise ValueError(f"ModeEdits.{name} {text}: invalid. Give {wanted}{point}.")
    return numbers
