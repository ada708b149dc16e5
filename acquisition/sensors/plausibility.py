"""Remarks on implausible sensitivities, units, calibration dates and stiffnesses."""

from collections.abc import Mapping
from datetime import date

from acquisition.channel import Channel, ChannelQuantity
from acquisition.errors import Remark
from acquisition.files.contents.units import POUND_FORCE, STANDARD_GRAVITY

SENSITIVITY_LIMITS: Mapping[ChannelQuantity, tuple[float, float, float, str]] = {
    "force": (0.1e-3, 25e-3, 1.0, "hammers have 0.1 to 25 mV/N without gain"),
    "acceleration": (1e-3, 1.0, STANDARD_GRAVITY, "accelerometers have 1 to 1000 mV/g without gain"),
}
"""Lowest and highest sensitivity on the market (V per shop unit), SI units per shop unit, and both in words."""
FULL_SCALE_LIMITS = (0.01, 100.0)
"""Smallest and largest range of a converter (V)."""
STIFFNESS_LIMITS = (1e5, 1e10)
"""Limits of modal stiffness at a tool tip or holder (N/m), from a thin end mill to a bare spindle nose."""
SENSITIVITY_SPREAD = 1.2
"""Factor by which a single sensor may deviate from its nominal sensitivity."""
UNIT_MISTAKE_TOLERANCE = 0.15
"""Relative deviation from the factor of a unit mistake up to which it explains a ratio."""
DAYS_PER_MONTH = 365.25 / 12

_G, _LBF = STANDARD_GRAVITY, POUND_FORCE
_MILLIVOLTS = "Check whether one sensitivity is in mV and the other in V"
_UNIT_MISTAKES: Mapping[float, tuple[str, str]] = {
    _G: ("9.81", "Check whether the acceleration is in g. Divide a sensitivity in V/g by 9.80665"),
    1 / _G: ("1/9.81", "Check whether a sensitivity in V per m/s^2 was divided by 9.80665 by mistake"),
    1 / _LBF: ("1/4.45", "Check whether the force is in lbf. Divide a sensitivity in V/lbf by 4.44822"),
    _LBF: ("4.45", "Check whether a sensitivity in V/N was divided by 4.44822 by mistake"),
    1e3: ("1000", f"{_MILLIVOLTS} (force 1000 times too large or acceleration too small)"),
    1e-3: ("1/1000", f"{_MILLIVOLTS} (force 1000 times too small or acceleration too large)"),
}


def unit_mistake_remark(ratio: float) -> Remark | None:
    """Return the remark on the unit mistake that explains F/(m a) of a known mass within 15 %.

    Parameters
    ----------
    ratio
        Ratio F/(m a) (-).

    Returns
    -------
    Remark or None
        Remark, None if no unit mistake explains the ratio.

    Examples
    --------
    >>> print(unit_mistake_remark(STANDARD_GRAVITY).text)
    the ratio F/(m a) = 9.807 is close to 9.81, a typical unit mistake
    >>> unit_mistake_remark(1.05) is None
    True
    """
    for factor, (value, cure) in _UNIT_MISTAKES.items():
        if abs(ratio / factor - 1) < UNIT_MISTAKE_TOLERANCE:
            text = f"the ratio F/(m a) = {ratio:.4g} is close to {value}, a typical unit mistake"
            return Remark("unit-mistake", "", text, cure)
    return None


def channel_remarks(channel: Channel) -> tuple[Remark, ...]:
    """Return remarks on an implausible sensitivity or range of a channel.

    Parameters
    ----------
    channel
        Channel to check.

    Returns
    -------
    tuple of Remark
        Remarks, empty if sensitivity and range are plausible.

    Examples
    --------
    >>> millivolts = Channel("acceleration", sensitivity=10.2, full_scale=5.0)  # taken for volts
    >>> [remark.code for remark in channel_remarks(millivolts)]
    ['sensitivity-not-believed']
    >>> channel_remarks(Channel("acceleration", sensitivity=10.2e-3 / 9.81, full_scale=5.0))
    ()
    """
    low, high, unit, usual = SENSITIVITY_LIMITS[channel.quantity]
    per = "N" if channel.quantity == "force" else "m/s^2"
    text = f"a sensitivity of {channel.sensitivity:g} V per {per} is implausible ({usual})"
    limits = low / SENSITIVITY_SPREAD, high * SENSITIVITY_SPREAD
    range_text = f"an input range of ±{channel.full_scale:g} V is implausible (converters have ±0.01 to ±100 V)"
    checks = (
        ("sensitivity-not-believed", text, abs(channel.sensitivity) * unit, limits),
        ("input-range-not-believed", range_text, channel.full_scale, FULL_SCALE_LIMITS),
    )
    return tuple(
        Remark(code, channel.name, text, _explain_slip(value, *limits))
        for code, text, value, limits in checks
        if not limits[0] <= value <= limits[1]
    )


def _explain_slip(value: float, low: float, high: float) -> str:
    """Return the advice on a slip by 1000 that explains a value outside its limits. Empty if it does not."""
    slips = {value / 1e3: "is in mV", value * 1e3: "was divided by 1000 twice"}
    slip = next((words for corrected, words in slips.items() if low <= corrected <= high), "")
    return f"Check whether the value {slip}" if slip else ""


def stiffness_remark(stiffness: float) -> Remark | None:
    """Return the remark on a modal stiffness outside the limits of machine tools.

    Parameters
    ----------
    stiffness
        Modal stiffness (N/m).

    Returns
    -------
    Remark or None
        Remark, None if the stiffness is plausible.

    Examples
    --------
    >>> stiffness_remark(2e7) is None, stiffness_remark(20.0).code  # N/m; 20 N/um is 2e7
    (True, 'stiffness-not-believed')
    """
    low, high = STIFFNESS_LIMITS
    if low <= abs(stiffness) <= high:
        return None
    shown = f"{stiffness:.0f} N/m" if abs(stiffness) < low else f"{stiffness / 1e6:.0f} N/um"
    text = f"stiffness K = {shown} is outside {low / 1e6:g} to {high / 1e6:.0f} N/um"
    cure = "Check the units of both sensitivities (g or m/s^2, mV or V, lbf or N) with a known mass"
    return Remark("stiffness-not-believed", "", text, cure)


def calibration_remark(channel: Channel, today: date, interval_months: float = 12.0) -> Remark | None:
    """Return the remark on an unknown, old or impossible calibration date of a sensor.

    Parameters
    ----------
    channel
        Channel of the sensor.
    today
        Date of today.
    interval_months
        Calibration interval (months).

    Returns
    -------
    Remark or None
        Remark, None if the calibration is recent.

    Examples
    --------
    >>> from datetime import date
    >>> sensor = Channel("force", 2.25e-3, 5.0, serial_number="4711", calibration_date="2024-02-01")
    >>> calibration_remark(sensor, date(2026, 3, 2)).code, calibration_remark(sensor, date(2024, 6, 1))
    ('calibration-old', None)
    """
    if not channel.calibration_date:
        text = "calibration date is missing"
        return Remark("calibration-unknown", channel.name, text, "Enter the date next to the sensitivity")
    try:
        calibrated = date.fromisoformat(channel.calibration_date[:10])
    except ValueError:
        text = f"calibration date {channel.calibration_date!r} is invalid"
        return Remark("calibration-no-date", channel.name, text, "Give the date as YYYY-MM-DD")
    if calibrated > today:
        text = f"calibration date {calibrated} is in the future (today is {today})"
        cure = "Correct the calibration date, or the clock of this computer"
        return Remark("calibration-in-future", channel.name, text, cure)
    months = (today - calibrated).days / DAYS_PER_MONTH
    if months <= interval_months:
        return None
    text = f"calibrated {calibrated}, {months:.0f} months ago (calibration interval {interval_months:g} months)"
    return Remark("calibration-old", channel.name, text, "Check the sensor with a known mass, or have it calibrated")
