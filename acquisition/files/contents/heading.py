"""The heading of a column: its name, its unit, and what it therefore is."""

from __future__ import annotations

import re

from acquisition.files.contents.contents import Role
from acquisition.files.contents.units import VOLTS, unit_of

_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.+?)\s*[\])]")
_PART_OF_FRF = re.compile(
    r"((?:re|real|im|imag|imaginary|abs|mag|magnitude|arg|angle|phase)\s*"
    r"[\[(]\s*(?!hz)(?:h|frf)\w*(?:\(\w+\))?\s*[\])])\s*(.*)",
    re.IGNORECASE,
)
"""Such as Re(H), or imag(FRF) [m/N]."""
ANGLES = {"deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg", "rad": "rad", "radians": "rad"}
"""Units of a phase as they are written in lower case."""
_BY_NAME: tuple[tuple[str, Role], ...] = (
    (r"(time|zeit|t$|x_value$)", "time"),
    (r"(freq|f$)", "frequency"),
    (r"(re\b|real)", "real"),
    (r"(im\b|imag)", "imag"),
    (r"(coh|kohärenz|gamma)", "coherence"),
    (r"(phase|angle|arg\b)", "phase"),
    (r"(mag|ampl|abs\b|betrag|db\b)", "magnitude"),
    (r"(frf|receptance|mobility|accelerance|h1\b|h2\b)", "frf"),
    (r"(force|hammer|kraft)", "force"),
    (r"(acc|resp|vel|disp|beschl)", "response"),
    (r"tacho", "tacho"),
)
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
    """Of "Force [N]", "Force (N)", "force_N" or "Re(H) [m/N]"; no unit where there is none that stands apart."""
    part = _PART_OF_FRF.fullmatch(heading)
    if part:
        return part[1], name_and_unit(part[2])[1]
    bracketed = _BRACKETS.fullmatch(heading)
    if bracketed:
        return bracketed[1], bracketed[2]
    for at in (underscore.start() for underscore in re.finditer("_", heading)):
        name, unit = heading[:at], heading[at + 1 :]
        if name and (is_unit(unit)):
            return name, unit
    return heading, ""


def is_unit(text: str) -> bool:
    """Whether it is a unit that is known, of an angle, of a level (dB) or of a voltage, too."""
    return unit_of(text) is not None or text.lower() in ANGLES | VOLTS or is_level(text)


def is_level(unit: str) -> bool:
    """Whether a unit is dB of something."""
    return unit.lower().startswith("db")


def role_of(name: str, unit: str) -> Role:
    """What a column is by its name and its unit, the unit first; empty where neither tells."""
    by_name = next((role for pattern, role in _BY_NAME if re.match(pattern, name.strip().lower())), "")
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
