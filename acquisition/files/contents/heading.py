"""The heading of a column: its name, its unit, and what it therefore is."""

from __future__ import annotations

import re
import unicodedata

from acquisition.files.contents.contents import Role
from acquisition.files.contents.units import VOLTS, unit_of

_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.+?)\s*[\])]")
_PART_OF_FRF = re.compile(
    r"((?:re|real|im|imag|imaginary|abs|mag|magnitude|arg|angle|phase)\s*"
    r"[\[(]\s*(?!hz)(?:h|frf)\w*(?:\(\w+\))?\s*[\])])\s*(.*)",
    re.IGNORECASE,
)
"""Such as Re(H), or imag(FRF) [m/N]."""
_BEFORE_UNIT = re.compile(r"\s*/\s*|\s*,\s*|\s+in\s+")
"""Between a name and its unit: "f / Hz", "Force, N", "Time in s"."""
ANGLES = dict.fromkeys(("deg", "degree", "degrees", "degrés", "grad", "gradi", "grados", "°", "度"), "deg") | {
    "rad": "rad",
    "radians": "rad",
}
"""Units of a phase as they are written in lower case."""
_LEVEL = re.compile(r"(?<![^\W_])db(?![^\W\d_])", re.IGNORECASE)
"""In the name of a level: "Magnitude dB", "Mag_dB"."""
_OF_FRF = re.compile(r"(frf|receptance|mobility|accelerance|h\d?)(?![^\W_])[\W\d_]*")
"""What stands before the part of an FRF that a column holds: "H1 real"."""
_BY_NAME: tuple[tuple[str, Role], ...] = (
    (r"time|zeit|temps|tiempo|tempo|时间|時間|t$|x_value$", "time"),
    (r"freq|frec|频率|頻率|周波数|f$", "frequency"),
    (r"re\b|real|reel|part\w+ re|实部|実部", "real"),
    (r"im\b|imag|part\w+ im|虚部", "imag"),
    (r"coh|koharenz|gamma|相干|コヒーレンス", "coherence"),
    (r"phase|fase|angle|arg\b|相位|位相", "phase"),
    (r"mag|ampl|ampiezza|module|modulo|abs\b|betrag|db\b|幅值|振幅", "magnitude"),
    (_OF_FRF.pattern, "frf"),
    (r"force|hammer|kraft|fuerza|forza|力", "force"),
    (r"acc|acel|resp|vel|disp|beschl|加速度|速度|位移|変位", "response"),
    (r"tacho", "tacho"),
)
"""Beginnings of names in lower case and without accents, in seven languages -> what the column is."""
ROLES: dict[str, tuple[Role, str]] = {
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
"""What `--columns` may call a column -> its role and quantity."""


def name_and_unit(heading: str) -> tuple[str, str]:
    """Of "Force [N]", "Force (N)", "Force / N", "force_N" or "Re(H) [m/N]"; no unit where none stands apart."""
    part = _PART_OF_FRF.fullmatch(heading)
    if part:
        return part[1], name_and_unit(part[2])[1]
    bracketed = _BRACKETS.fullmatch(heading)
    if bracketed:
        return bracketed[1], bracketed[2]
    for sign in (*re.finditer("_", heading), *_BEFORE_UNIT.finditer(heading)):
        name, unit = heading[: sign.start()], heading[sign.end() :]
        if name and is_unit(unit) and not is_unit(name.split()[-1]):
            return name, unit
    return heading, ""


def is_unit(text: str) -> bool:
    """Whether it is a unit that is known, of an angle, of a level (dB) or of a voltage, too."""
    return unit_of(text) is not None or text.lower() in ANGLES | VOLTS or is_level(text)


def is_level(unit: str) -> bool:
    """Whether a unit is dB of something."""
    return unit.lower().startswith("db")


def unit_by_name(name: str, unit: str) -> str:
    """The unit of a column; "dB m/N" where its name says that it is a level of what its unit says."""
    return f"dB {unit}".strip() if _LEVEL.search(name) and not is_level(unit) else unit


def unit_of_level(unit: str) -> str:
    """The unit that a level is a multiple of, "1 um/N" of "dB re 1 um/N"; empty where it does not say."""
    reference = re.sub(r"(?i)^db\s*(?:re[fl]?\b)?[.:]?(?:\)\s*[\[(]|[\s,)]*)", "", unit)
    is_known = unit_of(reference) is not None or ("/" in reference and reference.count("(") == reference.count(")"))
    return reference if is_known else ""


def role_of(name: str, unit: str) -> Role:
    """What a column is by its name and its unit, the unit first; empty where neither tells."""
    letters = unicodedata.normalize("NFKD", name.strip().lower())
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    plain = _OF_FRF.sub("", plain, count=1) if _OF_FRF.match(plain) and not _OF_FRF.fullmatch(plain) else plain
    by_name = next((role for pattern, role in _BY_NAME if re.match(pattern, plain)), "")
    parsed = unit_of(unit)
    quantity = parsed.quantity if parsed else ""
    if quantity == "frequency" and by_name != "frequency" and parsed == unit_of("rpm"):
        return "speed"
    of_frf = by_name in ("real", "imag", "magnitude", "phase", "coherence", "frf")
    if quantity in ("time", "frequency", "force") and not (len(name) > 1 and by_name in ("time", "frequency")):
        return quantity
    if quantity in ("displacement", "velocity", "acceleration") and not of_frf:
        return "response"
    return by_name  # type: ignore[return-value]
