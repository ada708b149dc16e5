"""Parse units of recorded files and convert them to SI."""

import math
import re
from dataclasses import dataclass
from typing import Literal

from acquisition.frf import FrfQuantity

Dimension = tuple[int, int, int]
"""Exponents of length, time and force."""
MeasuredQuantity = Literal["time", "frequency", "force", "displacement", "velocity", "acceleration", FrfQuantity, ""]
"""Quantity that a unit measures; empty for others."""

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity (m/s^2 per g)."""
POUND_FORCE = 4.4482216152605
"""Pound-force (N per lbf)."""

MOTION_QUANTITIES = ("displacement", "velocity", "acceleration")
"""Quantities of a response."""
VOLTAGE_UNITS = {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6, "µv": 1e-6}
"""Volts per unit of a voltage in lower case; no part of other units."""

QUANTITY_BY_DIMENSION: dict[Dimension, MeasuredQuantity] = {
    (0, 1, 0): "time",
    (0, -1, 0): "frequency",
    (0, 0, 1): "force",
    (1, 0, 0): "displacement",
    (1, -1, 0): "velocity",
    (1, -2, 0): "acceleration",
    (1, 0, -1): "receptance",
    (1, -1, -1): "mobility",
    (1, -2, -1): "accelerance",
}
"""Quantity by the exponents of length, time and force."""
_LENGTH, _TIME, _FREQUENCY, _FORCE, _DIMENSIONLESS = (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, 0)
_UNIT_GROUPS: tuple[tuple[Dimension, dict[str, float]], ...] = (
    (_LENGTH, {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "micron": 1e-6, "nm": 1e-9}),
    (_LENGTH, {"in": 0.0254, "inch": 0.0254, "mil": 2.54e-5, "ft": 0.3048}),
    (_TIME, {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6}),
    (_FREQUENCY, {"Hz": 1.0, "kHz": 1e3, "rpm": 1 / 60, "cpm": 1 / 60}),
    (_DIMENSIONLESS, {"rad": 1 / (2 * math.pi)}),
    (_FORCE, {"N": 1.0, "newton": 1.0, "newtons": 1.0, "daN": 10.0, "kN": 1e3, "mN": 1e-3}),
    (_FORCE, {"lbf": POUND_FORCE, "lb": POUND_FORCE, "kgf": STANDARD_GRAVITY}),
    ((-1, 2, 1), {"kg": 1.0}),
    ((1, -2, 0), {"g": STANDARD_GRAVITY, "gal": 1e-2, "gn": STANDARD_GRAVITY}),
)
_UNITS_BY_NAME = {name: (factor, group) for group, units in _UNIT_GROUPS for name, factor in units.items()}
_UNITS = _UNITS_BY_NAME | {name.lower(): value for name, value in _UNITS_BY_NAME.items() if name != "mN"}
"""Units as written and in lower case. Mega and milli differ only in case: MN is unknown, mN is known only as written.
"""
_TOKEN = re.compile(r"\s*(?:([A-Za-z]+)(?:\^?(-?\d+))?|(\d+(?:\.\d+)?(?:[eE]-?\d+)?)|([*/()])(?:\^(-?\d+))?)")
_TURNS_PER_MINUTE = re.compile(r"(1|r|u|rev|turns?) ?/ ?min|min ?\^?-1", re.IGNORECASE)
"""Turns per minute as they are written; minutes are no unit otherwise ("x_min" is a minimum)."""
_METERS_PER_SECOND = re.compile(r"\bms\^?-([12])\b")
"""Metres per second, or per second squared, without a sign between: no unit here is a power of a millisecond."""
_ASCII_EQUIVALENTS = str.maketrans({"µ": "u", "μ": "u", "¹": "^1", "²": "^2", "³": "^3", "·": "*", "⋅": "*", "_": "/"})


@dataclass(frozen=True)
class Unit:
    """Known unit."""

    quantity: MeasuredQuantity
    """Quantity that the unit measures; empty if no tap test has it."""
    factor: float
    """SI value of one unit."""


def parse_unit(text: str) -> Unit | None:
    """Parse a unit such as "um/N", "(m/s²)/N", "m_s2", "1/kg"; None if unknown.

    Hz, rad/s and rpm are frequencies, in Hz; g is standard gravity.
    """
    plain = re.sub(r"_?\bper\b_?|_per_", "/", text.strip()).replace("⁻", "-").translate(_ASCII_EQUIVALENTS)
    plain = _METERS_PER_SECOND.sub(r"m/s^\1", plain.replace("-^", "^-").replace("**", "^"))
    plain = "rpm" if _TURNS_PER_MINUTE.fullmatch(plain) else plain
    try:
        tokens = _tokenize(plain)
        value, dimension = _parse_product(tokens)
    except (ValueError, IndexError, OverflowError, ZeroDivisionError):
        return None
    named = any(token[0] for token in _TOKEN.findall(plain))
    return Unit(QUANTITY_BY_DIMENSION.get(dimension, ""), value) if named and not tokens and value > 0 else None


def get_motion(quantity: str) -> str:
    """Return the quantity of the response of an FRF quantity, and other quantities unchanged."""
    motions = {"receptance": "displacement", "mobility": "velocity", "accelerance": "acceleration"}
    return motions.get(quantity, quantity)


def _tokenize(text: str) -> list[tuple[str, str, str, str, str]]:
    """Split a unit into tokens in reverse order, so that pop() takes the next one."""
    tokens, at = list[tuple[str, str, str, str, str]](), 0
    while text[at:].strip():
        token = _TOKEN.match(text, at)
        if token is None:
            raise ValueError(text)
        tokens.append(token.groups(default=""))  # type: ignore[arg-type]
        at = token.end()
    return tokens[::-1]


def _parse_product(tokens: list[tuple[str, str, str, str, str]]) -> tuple[float, Dimension]:
    """Parse factors from left to right up to the end or a closing bracket, which remains."""
    value, dimension = _parse_factor(tokens)
    while tokens and tokens[-1][3] != ")":
        sign = -1 if tokens[-1][3] == "/" else 1
        if tokens[-1][3] in ("*", "/"):
            tokens.pop()
        factor, exponents = _parse_factor(tokens)
        value *= factor**sign
        dimension = tuple(a + sign * b for a, b in zip(dimension, exponents, strict=True))  # type: ignore[assignment]
    return value, dimension


def _parse_factor(tokens: list[tuple[str, str, str, str, str]]) -> tuple[float, Dimension]:
    name, power, number, sign, _ = tokens.pop()
    unit = _UNITS.get(name) or _UNITS.get(name.lower())
    if number:
        return float(number), _DIMENSIONLESS
    if sign == "(":
        (value, dimension), power = _parse_product(tokens), tokens.pop()[4]
    elif unit is None:
        raise ValueError(name or sign)
    else:
        value, dimension = unit
    exponent = int(power or 1)
    if abs(exponent) > 9:
        raise ValueError(power)
    return value**exponent, tuple(exponent * part for part in dimension)  # type: ignore[return-value]
