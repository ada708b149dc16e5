"""Numbers as people type them: `1000`, `2.5`, `2,5`, `18'000`, `1,234.5`.

A comma or a point before three digits may be a decimal sign or a separator of thousands. A plausible range and the
other numbers of the same answer decide. If both readings remain, the number is rejected with both of them.
"""

import re
from collections.abc import Mapping, Sequence

GROUP_SIGNS = "'\u2019\u00a0\u2009\u202f_"
"""Signs that only separate thousands: apostrophes, narrow blanks, and the underscore of TOML and Python."""
SEPARATED_NUMBER_PATTERN = rf"\d+(?:[.,{GROUP_SIGNS} ]\d+)*"
"""Number with any signs between its digits."""
NUMBER_TOKEN_PATTERN = re.compile(rf"\d+(?:[.,{GROUP_SIGNS}]\d+)*(?:[eE][+-]?\d+)?")
"""Number with any signs between its digits, except for a blank, which ends it."""
ANSWER_TOKEN_PATTERN = re.compile(
    rf"(?:(?P<whole>\d+)-(?=\d+/\d))?(?P<number>{NUMBER_TOKEN_PATTERN.pattern})(?:/(?P<divisor>[1-9]\d*))?"
    rf"(?:\s*(?P<unit>\"|(?:mm|um|µm|cm|in|inch|inches|mil|thou|ipt|in/tooth|hp|W)(?![^\s,;])))?",
    re.IGNORECASE,
)
"""Number or fraction with a unit that may replace that of the question. A blank separates numbers: `1-1/2in`."""
DECIMAL_SIGNS = (",.", ",", ".", "")
"""Signs that may be decimal in one answer. The other ones separate thousands."""
ANSWER_UNITS = {"rpm", "1/min", "mm", "mm/tooth", "deg", "°", "kw", "nm", "n·m", "mv/n", "mv/g", "g", "v", "x"}
ANSWER_UNITS |= {"teeth", "flutes"}
"""Units that may stand between numbers."""
ValueLimits = tuple[float, float]
"""Smallest and largest plausible value."""


def read_number(text: str, decimal_signs: str) -> float | None:
    """Read a number if these signs are decimal and all others separate thousands; None if it is no number then.

    >>> read_number("18,000", ","), read_number("18,000", "."), read_number("1,23", ".")
    (18.0, 18000.0, None)
    """
    separators = re.escape("".join(sign for sign in ",." if sign not in decimal_signs))
    groups = rf"[1-9]\d{{0,2}}([{separators}{GROUP_SIGNS} ])\d{{3}}(?:\1\d{{3}})*"
    fraction = rf"(?:[{re.escape(decimal_signs)}]\d+)?" if decimal_signs else ""
    if not re.fullmatch(rf"[+-]?(?:{groups}|0|[1-9]\d*){fraction}(?:[eE][+-]?\d+)?", text):
        return None
    decimal = re.sub(f"[{re.escape(decimal_signs)}]", "#", text) if decimal_signs else text
    return float(re.sub(r"[^\deE#+-]", "", decimal).replace("#", "."))


def list_readings(text: str) -> list[float]:
    """List the different values that a number may have, the decimal one first; empty if it is no number."""
    values = (read_number(text.strip(), signs) for signs in DECIMAL_SIGNS)
    return list(dict.fromkeys(value for value in values if value is not None))


def read_numbers(texts: Sequence[str], limits: Sequence[ValueLimits | None] = ()) -> list[float]:
    """Read the numbers of one answer, whose signs have one use.

    Parameters
    ----------
    texts
        Numbers as typed.
    limits
        Plausible range of each number, None for any; missing ones at the end are None.

    Raises
    ------
    ValueError
        For a text that is no number, and for one with two plausible values.
    """
    ranges = [*limits, *[None] * len(texts)]
    answers = [[read_number(text, signs) for text in texts] for signs in DECIMAL_SIGNS]
    complete = {tuple(value for value in values if value is not None) for values in answers if None not in values}
    plausible = {values for values in complete if all(map(_is_within, values, ranges))}
    if len(found := plausible or complete) == 1:
        return list(found.pop())
    for text in texts:
        require_one_reading(text)
    listed = " and ".join(map(repr, texts))
    raise ValueError(f"{listed} have different decimal signs. Write all numbers with a decimal point.")


def parse_numbers(
    answer: str,
    names: Sequence[str],
    least: int | None = None,
    limits: Sequence[ValueLimits | None] = (),
    units: Sequence[Mapping[str, float] | None] = (),
) -> list[float]:
    """Parse the numbers of an answer, at least `least` or one per name; ValueError names them.

    limits: plausible range of each number, which tells a decimal sign from a separator of thousands. units: factor of
    each unit of a number, "" without one; missing ones at the end are None, for a number without other units.
    """
    words = ANSWER_TOKEN_PATTERN.sub(" ", answer)
    strange = [word for word in re.split(r"[\s,;]+", words) if word and word.casefold() not in ANSWER_UNITS]
    if strange:
        raise ValueError(f"{answer!r}: {strange[0]!r} is neither a number nor a unit. Enter {', '.join(names)}.")
    numbers = list(ANSWER_TOKEN_PATTERN.finditer(answer))
    if not (len(names) if least is None else least) <= len(numbers) <= len(names):
        count = "1 number" if len(numbers) == 1 else f"{len(numbers)} numbers"
        raise ValueError(f"{answer!r} has {count}. Enter {', '.join(names)}, with spaces only between them.")
    factors = [_unit_factor(*pair) for pair in zip(numbers, [*units, *[None] * len(numbers)], strict=False)]
    scaled = [limit and (limit[0] / f, limit[1] / f) for limit, f in zip(limits, factors, strict=False)]
    values = read_numbers([number["number"] for number in numbers], scaled)
    wholes = [int(number["whole"] or 0) * int(number["divisor"] or 1) for number in numbers]
    return [float(f"{(n + w) * f:.12g}") for n, w, f in zip(values, wholes, factors, strict=True)]


def _unit_factor(token: re.Match[str], units: Mapping[str, float] | None) -> float:
    """Return the factor that converts a number of an answer; ValueError for a unit of another quantity."""
    factors = {name.casefold(): factor for name, factor in (units or {"": 1.0, "mm": 1.0}).items()}
    if (unit := (token["unit"] or "").casefold()) not in factors:
        allowed = ", ".join(name for name in units or () if name)
        raise ValueError(f"{token[0]!r} has another unit. " + (f"Use {allowed}." if allowed else "Leave out the unit."))
    if token["divisor"] and not unit and factors[unit] == 1:
        raise ValueError(f"{token[0]!r} has no unit. Write {token[0]}in for inches.")
    return factors[unit] / int(token["divisor"] or 1)


def require_one_reading(text: str) -> None:
    """Raise ValueError for a text that is no number, or that may have two values."""
    readings = list_readings(text)
    if not readings:
        raise ValueError(f"{text!r} is not a number. Write numbers as 18000 or 18.5.")
    if len(readings) > 1:
        raise ValueError(f"{text!r} may be {' or '.join(map(format_number, readings))}. Write one of these.")


def _is_within(value: float, limits: ValueLimits | None) -> bool:
    return limits is None or limits[0] <= value <= limits[1]


def format_number(value: float) -> str:
    """Format a number as it is typed.

    >>> format_number(18000.0), format_number(2.5)
    ('18000', '2.5')
    """
    return f"{value:.10g}"
