"""Infer name, unit and role of columns from their headings or from user input."""

import re
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import get_args

from acquisition.files.contents.contents import FrfRole, ImportReport, Role, Signal
from acquisition.files.contents.units import VOLTAGE_UNITS, parse_unit

_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.+?)\s*[\])]")
_PART_OF_FRF = re.compile(
    r"((?:re|real|im|imag|imaginary|abs|mag|magnitude|arg|angle|phase)\s*"
    r"[\[(]\s*(?!hz)(?:h|frf)\w*(?:\(\w+\))?\s*[\])])\s*(.*)",
    re.IGNORECASE,
)
"""Pattern such as Re(H), or imag(FRF) [m/N]."""
_BEFORE_UNIT = re.compile(r"\s*/\s*|\s*,\s*|\s+in\s+")
"""Separator between a name and its unit: "f / Hz", "Force, N", "Time in s"."""
_DEGREE_NAMES = ("deg", "degree", "degrees", "degrés", "grad", "gradi", "grados", "°", "度")
ANGLE_UNITS = dict.fromkeys(_DEGREE_NAMES, "deg") | dict.fromkeys(("rad", "radians"), "rad")
"""Units of a phase as written in lower case."""
_DECIBEL_NAME = re.compile(r"(?<![^\W_])db(?![^\W\d_])", re.IGNORECASE)
"""Pattern of a level in a name: "Magnitude dB", "Mag_dB"."""
_FRF_PREFIX = re.compile(r"(frf|receptance|mobility|accelerance|h\d?)(?![^\W_])[\W\d_]*")
"""Prefix of a part of an FRF: "H1 real"."""
_ROLE_PATTERNS: tuple[tuple[str, Role], ...] = (
    (r"time|zeit|temps|tiempo|tempo|时间|時間|t$|x_value$", "time"),
    (r"freq|frec|频率|頻率|周波数|f$", "frequency"),
    (r"re\b|real|reel|part\w+ re|实部|実部", "real"),
    (r"im\b|imag|part\w+ im|虚部", "imag"),
    (r"coh|koharenz|gamma|相干|コヒーレンス", "coherence"),
    (r"phase|fase|angle|arg\b|相位|位相", "phase"),
    (r"mag|ampl|ampiezza|module|modulo|abs\b|betrag|db\b|幅值|振幅", "magnitude"),
    (_FRF_PREFIX.pattern, "frf"),
    (r"force|hammer|kraft|fuerza|forza|力", "force"),
    (r"acc|acel|resp|vel|disp|beschl|加速度|速度|位移|変位", "response"),
    (r"tacho", "tacho"),
)
"""Role of a column by the beginning of its name in lower case and without accents, in seven languages."""
COLUMN_ROLES: dict[str, tuple[Role, str]] = {
    "time": ("time", ""),
    "frequency": ("frequency", ""),
    "force": ("force", "force"),
    "response": ("response", ""),
    "acceleration": ("response", "acceleration"),
    "velocity": ("response", "velocity"),
    "displacement": ("response", "displacement"),
    "frf": ("frf", ""),
    "receptance": ("frf", "displacement"),
    "mobility": ("frf", "velocity"),
    "accelerance": ("frf", "acceleration"),
    "real": ("real", ""),
    "imag": ("imag", ""),
    "magnitude": ("magnitude", ""),
    "db": ("magnitude", ""),
    "phase": ("phase", ""),
    "coherence": ("coherence", ""),
    "speed": ("speed", ""),
    "tacho": ("tacho", ""),
    "-": ("ignored", ""),
}
"""Role and quantity of a column, by its word in `Description.columns`."""


def split_heading(heading: str) -> tuple[str, str]:
    """Split "Force [N]", "Force (N)", "Force / N", "force_N" or "Re(H) [m/N]" into name and unit, empty if unknown."""
    part = _PART_OF_FRF.fullmatch(heading)
    if part:
        return part[1], split_heading(part[2])[1]
    bracketed = _BRACKETS.fullmatch(heading)
    if bracketed:
        return bracketed[1], bracketed[2]
    for sign in (*re.finditer("_", heading), *_BEFORE_UNIT.finditer(heading)):
        name, unit = heading[: sign.start()], heading[sign.end() :]
        if name and is_unit(unit) and not is_unit(name.split()[-1]):
            return name, unit
    return heading, ""


def is_unit(text: str) -> bool:
    """Return whether a text is a known unit, also of an angle, a level (dB) or a voltage."""
    return parse_unit(text) is not None or text.lower() in ANGLE_UNITS | VOLTAGE_UNITS or is_decibel(text)


def is_decibel(unit: str) -> bool:
    """Return whether a unit is dB of something."""
    return unit.lower().startswith("db")


def infer_decibel_unit(name: str, unit: str) -> str:
    """Return the unit of a column, "dB m/N" where its name states a level."""
    return f"dB {unit}".strip() if _DECIBEL_NAME.search(name) and not is_decibel(unit) else unit


def parse_decibel_reference(unit: str) -> str:
    """Return the reference of a level, "1 um/N" of "dB re 1 um/N"; empty if unknown."""
    reference = re.sub(r"(?i)^db\s*(?:re[fl]?\b)?[.:]?(?:\)\s*[\[(]|[\s,)]*)", "", unit)
    is_known = parse_unit(reference) is not None or ("/" in reference and reference.count("(") == reference.count(")"))
    return reference if is_known else ""


def infer_role(name: str, unit: str) -> Role:
    """Infer the role of a column from its unit and its name; empty if neither shows it."""
    letters = unicodedata.normalize("NFKD", name.strip().lower())
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    plain = plain if _FRF_PREFIX.fullmatch(plain) else re.sub(rf"^(?:{_FRF_PREFIX.pattern})", "", plain, count=1)
    by_name = next((role for pattern, role in _ROLE_PATTERNS if re.match(pattern, plain)), "")
    parsed = parse_unit(unit)
    quantity = parsed.quantity if parsed else ""
    if quantity == "frequency" and by_name != "frequency" and parsed == parse_unit("rpm"):
        return "speed"
    if quantity in ("time", "frequency", "force") and not (len(name) > 1 and by_name in ("time", "frequency")):
        return quantity
    if quantity in ("displacement", "velocity", "acceleration") and by_name not in get_args(FrfRole):
        return "response"
    return by_name  # type: ignore[return-value]


def assign_columns(signals: tuple[Signal, ...], report: ImportReport) -> tuple[Signal, ...]:
    """Return the signals with the roles and units that `Description.columns` gives them, in its order, only these.

    "time [s]" names the next column, "frf [m/N]=H1" or "frf=H1 [m/N]" the signal of this name, heading, unit or number,
    "frf=H:2" the second column of H. A unit replaces unit and quantity of the file. Without `columns` all signals stay
    as they are.
    """
    named, columns = list[Signal](), report.description.columns
    if not columns:
        return signals
    if len(columns) < len(signals) and not any("=" in text for text in columns):
        fault = f"{len(columns)} of {len(signals)} columns are named ({format_signal_names(signals)})"
        cure = 'Name all columns in the order of the file ("-" skips a column), or name each by number, as in "real=2"'
        report.reject("columns", None, fault, cure)
    for number, text in enumerate(columns):
        heading, _, name = text.partition("=")
        word, unit = split_heading(heading.strip())
        name, unit = _move_unit(signals, name.strip(), unit)
        signal = report.attempt(_select_signal, signals, name, number)
        role = COLUMN_ROLES.get(word.strip().lower())
        if role is None:
            report.reject("columns", repr(text), f"heading {word!r} is not one of {', '.join(COLUMN_ROLES)}")
        elif signal is not None and role[0] != "ignored":
            quantity = role[1] or ("" if unit else signal.quantity)
            unit = infer_decibel_unit(word, unit or signal.unit)
            if any(signal.values is other.values for other in named):
                report.reject("columns", repr(text), f"column {signal.name} is named twice")
            named.append(replace(signal, role=role[0], quantity=quantity, unit=unit, record=0))
    return tuple(named)


def _move_unit(signals: Sequence[Signal], name: str, unit: str) -> tuple[str, str]:
    """Return the name of a column without the unit behind it, and this unit, unless a column is named so."""
    bare, behind = split_heading(name)
    is_new = is_unit(behind) and unit in ("", behind) and not _match_columns(signals, name)
    return (bare, behind) if is_new and _match_columns(signals, bare) else (name, unit)


def _select_signal(signals: Sequence[Signal], name: str, number: int, report: ImportReport) -> Signal:
    if name:
        return find_column(signals, name, "columns", report)
    if number < len(signals):
        return signals[number]
    held = format_signal_names(signals)
    raise report.reject("columns", None, f"no column {number + 1} in the file, only {held}")


def find_column(signals: Sequence[Signal], name: str, field_name: str, report: ImportReport) -> Signal:
    """Find the one column of a name, heading, unit or number."""
    meant = _match_columns(signals, name)
    if len(meant) == 1:
        return meant[0]
    if meant:
        numbers = ", ".join(f"{i}" for i, signal in enumerate(signals, 1) if signal in meant)
        fault = f"{len(meant)} columns have the name {name!r}"
        raise report.reject(field_name, None, fault, f"Give the number of the column instead ({numbers})")
    raise report.reject(field_name, None, f"no column {name!r} in the file, only {format_signal_names(signals)}")


def _match_columns(signals: Sequence[Signal], name: str) -> Sequence[Signal]:
    """Return the columns of a name, else shown so, of this number, or of this unit."""
    unit = parse_unit(name)
    tests: tuple[Callable[[int, Signal], bool], ...] = (
        lambda _, signal: signal.name == name,
        lambda _, signal: name in (_format_signal_name(signal), _format_signal_name(signal, with_size=True)),
        lambda _, signal: bool(signal.unit) and split_heading(name) == (signal.name, signal.unit),
        lambda _, signal: re.fullmatch(rf"{re.escape(name)}:\d+", signal.name) is not None,
        lambda number, _: name == str(number),
        lambda _, signal: bool(signal.unit) and (signal.unit == name or unit == parse_unit(signal.unit) is not None),
    )
    for test in tests:
        if meant := [signal for number, signal in enumerate(signals, 1) if test(number, signal)]:
            return meant
    return []


def format_signal_names(signals: Sequence[Signal], most: int = 12) -> str:
    """Return the names and units of signals for a sentence, with their lengths where these differ."""
    with_size = len({signal.values.size for signal in signals}) > 1
    names = [_format_signal_name(signal, with_size=with_size) for signal in signals]
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _format_signal_name(signal: Signal, *, with_size: bool = False) -> str:
    text = f"{signal.name} [{signal.unit}]" if signal.unit else signal.name
    return re.sub(r"\s+", " ", text) + (f" ({signal.values.size})" if with_size else "")
