"""Faults of a hit: flags, words, remedies, limits and sentences in one place."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

_DIFFERS = "FRF of this hit differs by {distance:.0%} from the mean of {count} hits (limit {limit:.0%})"
_RINGS = "The last tenth of the response still has {share:.1%} of the rms value of the loudest tenth"

TOUCH_TEXT = "Second force peak {delay:.2g} ms {side} the main peak ({percent:.2g} % of its height)"
"""Finding of a further touch, as a fault or as a note."""


class HitFlags(enum.Flag):
    """Faults of a hit; falsy for a good hit. `str()` gives words and remedies.

    Examples
    --------
    >>> flags = HitFlags.DOUBLE_HIT | HitFlags.OVERLOAD_FORCE
    >>> flags.words
    'double hit, overload (force)'
    >>> HitFlags.from_words("double hit") in flags, bool(HitFlags.OK)
    (True, False)
    """

    OK = 0
    """No fault."""
    DOUBLE_HIT = enum.auto()
    """The hammer touched twice, with a hole in the force spectrum or a response that the record does not hold."""
    OVERLOAD_FORCE = enum.auto()
    """The force is clipped."""
    OVERLOAD_RESPONSE = enum.auto()
    """The response is clipped."""
    TOO_SOFT = enum.auto()
    """The peak of the force is near the noise, or small against its range."""
    NOT_DECAYED = enum.auto()
    """The response still vibrates when the record ends."""
    LOST_SCANS = enum.auto()
    """Scans are missing inside the record."""
    NO_HIT = enum.auto()
    """No pulse exceeds the noise."""
    SWAPPED_CHANNELS = enum.auto()
    """The pulse is on the channel of the response."""
    TOO_HARD = enum.auto()
    """The peak of the force is near the end of its range, not clipped."""
    NARROW_BAND = enum.auto()
    """The force does not reach to the end of the required frequency band."""
    INCONSISTENT = enum.auto()
    """The FRF of this hit differs from the mean of the good hits."""
    UNDONE = enum.auto()
    """The operator removed the hit."""
    NOT_EVALUATED = enum.auto()
    """The evaluation failed."""
    NO_RESPONSE = enum.auto()
    """The response is not above its noise."""
    SURPLUS = enum.auto()
    """The hit is good, but enough others agree better."""
    STEADY_VIBRATION = enum.auto()
    """A steady vibration began after the self-check, as that of a turning spindle."""

    @property
    def words(self) -> str:
        """Faults in words, e.g. "double hit, overload (force)"; "good" without one."""
        return ", ".join(HIT_FAULTS[flag].words for flag in self) or "good"

    @property
    def cure(self) -> str:
        """Remedies, a sentence per fault; empty for a good hit."""
        return " ".join(HIT_FAULTS[flag].remedy for flag in self)

    @property
    def codes(self) -> tuple[str, ...]:
        """Code of each fault, as options and the journal name it, e.g. "double-hit"."""
        return tuple(str(flag.name).lower().replace("_", "-") for flag in self)

    @classmethod
    def from_codes(cls, codes: Iterable[str]) -> HitFlags:
        """Return the flags of codes.

        Parameters
        ----------
        codes
            Codes, as `codes` gives them.

        Returns
        -------
        HitFlags
            All flags that the codes name.

        Raises
        ------
        ValueError
            If a code names no flag.
        """
        by_code, flags = {code: flag for flag in cls for code in flag.codes}, cls.OK
        for code in codes:
            if code not in by_code:
                raise ValueError(f"hit code {code!r} does not exist. Choose from {', '.join(by_code)}.")
            flags |= by_code[code]
        return flags

    @classmethod
    def from_words(cls, words: str) -> HitFlags:
        """Return the flags that a file states in words.

        Parameters
        ----------
        words
            `HitFlags.words` of the flags.

        Returns
        -------
        HitFlags
            All flags that the words name.

        Raises
        ------
        ValueError
            Where a word names no flag.
        """
        by_words = {fault.words: flag for flag, fault in HIT_FAULTS.items()}
        flags = cls.OK
        for word in filter(None, words.removeprefix("good").split(", ")):
            if word not in by_words:
                raise ValueError(f"hit verdict {word!r} is not one of {', '.join(by_words)}")
            flags |= by_words[word]
        return flags

    def __str__(self) -> str:
        """Return each fault with its remedy."""
        return " ".join(f"{fault.words}: {fault.remedy}" for fault in map(HIT_FAULTS.__getitem__, self)) or "good"


@dataclass(frozen=True)
class HitFault:
    """One fault of a hit: its words in files, its remedy, and the limits and sentences of its findings."""

    words: str
    """Words that tap files store and tables show."""
    remedy: str
    """Advice to the operator, in sentences."""
    sentences: Mapping[str, str] = field(default_factory=dict)
    """Format string of each finding without the full stop, by its case; "" is the only or usual case."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """Limits that decide whether a hit has the fault, by the name that the sentences use."""

    def state(self, case: str = "", **figures: object) -> str:
        """Return the sentence of a finding with its limits and figures."""
        return self.sentences[case].format(**self.limits, **figures)


HIT_FAULTS: Mapping[HitFlags, HitFault] = {
    HitFlags.DOUBLE_HIT: HitFault(
        "double hit",
        "Let the hammer bounce off after the hit.",
        {
            "hole": f"{TOUCH_TEXT} leaves a hole in the force spectrum at {{hole:.3g}} Hz",
            "merged": "Two force peaks in one pulse leave a hole in the force spectrum at {hole:.3g} Hz",
            "late": f"{TOUCH_TEXT} leaves its response too little time to decay",
            "decay": "The decay is disturbed {delay:.2g} ms after the hit, probably by a double hit",
        },
    ),
    HitFlags.OVERLOAD_FORCE: HitFault(
        "overload (force)",
        "Hit softer or choose a larger force range.",
        {
            "": "Force clipped at {level:.4g} N for {samples} samples{note}",
            "reported": "The device reports an overload of the force",
        },
    ),
    HitFlags.OVERLOAD_RESPONSE: HitFault(
        "overload (response)",
        "Hit softer or choose a larger acceleration range.",
        {
            "": "Response clipped at {level:.4g} m/s^2 for {samples} samples{note}",
            "reported": "The device reports an overload of the response",
        },
    ),
    HitFlags.TOO_SOFT: HitFault(
        "too soft",
        "Hit harder.",
        {
            "range": "Force peak of {peak:.4g} N is below {range_share:.0%} of the range of {full:.0f} N",
            "noise": "Force peak of {peak:.4g} N is below {noise_ratio:.0f} times the noise of {noise:.3g} N",
            "response": "Response of {peak:.3g} m/s^2 is below {noise_ratio:.0f} times the noise of {noise:.2g} m/s^2",
            "spectrum": "The force spectrum is 20 dB below its largest value from {start:.3g} Hz on",
        },
        {"range_share": 0.02, "noise_ratio": 20.0},
    ),
    HitFlags.NOT_DECAYED: HitFault(
        "not decayed",
        "Use a longer record, and wait until the tool is still before the next hit.",
        {"": _RINGS, "hum": f"{_RINGS}, maybe mains hum (record 20 ms before the hit to confirm)"},
        {"residual_share": 0.02, "noise_ratio": 2.0},
    ),
    HitFlags.LOST_SCANS: HitFault(
        "lost scans",
        "Hit again. If samples are lost again, lower the sample rate or change the cable.",
        {"": "{count} samples per channel are missing in this record"},
    ),
    HitFlags.NO_HIT: HitFault(
        "no hit",
        "Check the hammer cable and the trigger level.",
        {
            "": "No hammer pulse above the noise of the force signal",
            "cut": "The record begins inside the force pulse, at {share:.0%} of its peak",
        },
        {"first_share": 0.1},
    ),
    HitFlags.SWAPPED_CHANNELS: HitFault(
        "swapped channels",
        "Swap the cables of hammer and accelerometer.",
        {"": "The force channel vibrates after the hit, the response channel does not"},
    ),
    HitFlags.TOO_HARD: HitFault(
        "too hard",
        "Hit softer or choose a larger force range.",
        {"": "Force peak of {peak:.4g} N is {share:.0%} of the range of {full:.0f} N"},
        {"range_share": 0.9},
    ),
    HitFlags.NARROW_BAND: HitFault(
        "narrow band",
        "Use a harder hammer tip.",
        {
            "": "The force spectrum reaches {reach:.0f} Hz (-20 dB) of the required {end:g} Hz",
            "long": "The force pulse lasts {length:.2g} ms, as of a soft tip, and gives no response above its noise",
        },
    ),
    HitFlags.INCONSISTENT: HitFault(
        "inconsistent",
        "Hit the same spot in the same direction as in the other hits, and check that the accelerometer is fixed.",
        {
            "": _DIFFERS,
            "weaker": f"{_DIFFERS} and has {{share:.0%}} of its magnitude, as with a loose accelerometer",
        },
        {"mean_distance": 0.3, "noise_ratio": 4.0},
    ),
    HitFlags.UNDONE: HitFault("undone", "The operator removed this hit."),
    HitFlags.NOT_EVALUATED: HitFault(
        "not judged",
        "Hit again. If the evaluation fails again, check hammer, accelerometer and cables.",
        {"": "The evaluation of this hit failed ({reason})"},
    ),
    HitFlags.NO_RESPONSE: HitFault(
        "no response",
        "Check the accelerometer and its cable.",
        {
            "": "The response in its loudest tenth is {ratio:.2g} times its noise (limit {noise_ratio:g})",
            "constant": "The response is constant",
            "steady": "The response of {level:.3g} m/s^2 rms is hum or drift that does not answer the hit",
            "saturated": "The response is at the limit of its range already before the hit",
        },
        {"noise_ratio": 1.15},
    ),
    HitFlags.SURPLUS: HitFault("surplus", "Enough other hits agree better with each other."),
    HitFlags.STEADY_VIBRATION: HitFault(
        "steady vibration",
        "Stop the spindle and nearby machines, then hit again. If the spindle stands still, check the cable.",
        {"": "Since the self-check, {finding}"},
        {"rest_ratio": 3.0},
    ),
}
"""Fault of each flag.

The limits are chosen. A peak below 2 % of the force range shows the steps of the converter. Above 90 % the sensor may
saturate before its converter. The last tenth of the response may have 2 % of the rms of its loudest tenth, or twice the
noise. The loudest tenth of mere noise is below 1.15 times its rms before the hit. A hit 30 % away from the mean would
move a mean of ten hits by 3 %. Its distance must also be 4 times what the scatter of the hits would give. A pulse whose
first 10 % of the peak are missing has lost 1 % of its impulse. A steady vibration has 3 times the rms at rest.
"""
