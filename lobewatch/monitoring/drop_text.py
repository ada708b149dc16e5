"""Words for the drop of a series, the same in all texts.

Imported with every look at a fleet, so without numpy.
"""

import math

from dsm import format_with_error


def format_change(drop: float, half_width: float | None) -> str:
    """Return a drop (%) as a change with its 95 % interval, such as "-0.24 ± 0.40 %"."""
    if not half_width or not math.isfinite(half_width):
        return f"{-drop:+z.2f} %"
    sign = "+" if drop < 0 else ""
    return f"{sign}{format_with_error(-drop, half_width)} %"


def format_below_start(drop: float, half_width: float | None) -> str:
    """Return a drop (%) with its 95 % interval, such as "10.06 ± 0.31 % below the first tests"."""
    return f"{format_with_error(abs(drop), half_width)} % {'below' if drop >= 0 else 'above'} the first tests"


def describe_drop(drop: float | None, half_width: float | None, *, is_proven: bool) -> str:
    """Return the finding on a drop (%); a change is claimed only if it is proven.

    Between the 95 % interval and the score of an alarm it is not certain yet.
    """
    if drop is None or not math.isfinite(drop):
        return "unknown"
    if half_width == 0:
        return "first test, no comparison yet"
    change = format_change(drop, half_width)
    if is_proven:
        return f"frequency {change} since the first tests"
    is_outside = half_width is not None and abs(drop) > half_width
    return f"{'change not certain yet' if is_outside else 'no change proven'} ({change})"
