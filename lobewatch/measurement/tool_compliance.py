"""Static compliance at the tool tip compared with that of the tool alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import modal
from acquisition import Remark
from dsm import MATERIALS, format_rounded
from lobes import ToolMaterial
from lobewatch.machine import Machine, find_tool_properties
from lobewatch.measurement.recording_questions import TOOL_COMPLIANCE
from modal import Mode

EFFECTIVE_DIAMETER_RATIO = 0.8
"""Diameter of a solid cylinder as stiff as the fluted part over the cutter diameter, for two and four flutes.

Kops & Vo (1990), Determination of the equivalent diameter of an end mill based on its compliance, CIRP Annals 39."""
SHANK_MATERIALS: dict[ToolMaterial, str] = {"HSS": "steel", "carbide": "carbide", "coated carbide": "carbide"}
"""Material of the tool body by that of its edges; PCD and CBN are brazed to either."""
MIN_SLENDERNESS = 2.0
"""Smallest stick-out over diameter of a tool that bends as a beam."""
MIN_COMPLIANCE_RATIO = 0.8
"""Smallest ratio of the compliance at the tip to that of the clamped tool; chosen.

Tip compliance adds holder and spindle to the tool: tests have 1.2 and more. The tool alone is known within a fifth:
effective diameter within 3 %, stick-out within 3 %, Young's modulus within 5 %."""
STANDARD_SHANKS = (0.006, 0.008, 0.010, 0.012, 0.014, 0.016, 0.018, 0.020, 0.025, 0.032)
"""Shank diameters of solid end mills (m), DIN 6535 from 6 mm on: cutters of up to 6 mm have the first (DIN 6527)."""
SUPPORT_COMPLIANCE = 5e-8
"""Static compliance of a soft holder and spindle (m/N), 20 N/um; chosen."""
CANTILEVER_CONSTANT = 1.8751
"""First root of cos(x) cosh(x) = -1 (Rao, Mechanical Vibrations, ch. 8.5)."""


class ToolAgreement(StrEnum):
    """Agreement of the compliance at the tip with the geometry of the tool."""

    AGREES = "agrees"
    """Softer than the tool alone, and less than three times softer than plausible."""
    TOO_STIFF = "too stiff"
    """Stiffer than the tool alone."""
    TOO_SOFT = "too soft"
    """More than three times softer than plausible."""
    UNKNOWN = "unknown"
    """The tool is not described, or the test does not reach its natural frequency."""


@dataclass(frozen=True)
class ToolBeam:
    """Tool as a clamped cantilever."""

    diameter: float
    """Diameter of the cutter (m)."""
    stick_out: float
    """Length outside of the holder (m)."""
    flute_length: float
    """Length of the fluted part (m)."""
    material: str
    """Material of the body, a name of `dsm.MATERIALS`."""

    shank_diameter: float | None = None
    """Diameter above the flutes (m); None if unknown, then counted as that of the cutter."""

    @property
    def compliance(self) -> float:
        """Static compliance at the tip (m/N): beam of two diameters, fluted and solid."""
        modulus, fluted = MATERIALS[self.material].youngs_modulus, min(self.flute_length, self.stick_out)
        bent = fluted**3 / (EFFECTIVE_DIAMETER_RATIO * self.diameter) ** 4
        bent += (self.stick_out**3 - fluted**3) / self.solid_diameter**4
        return 64 * bent / (3 * math.pi * modulus)

    @property
    def solid_diameter(self) -> float:
        """Diameter above the flutes (m)."""
        return self.diameter if self.shank_diameter is None else self.shank_diameter

    @property
    def stiffest(self) -> "ToolBeam":
        """Stiffest tool that it can be: an unknown shank is the next standard one, and unknown flutes are short."""
        shank = next((size for size in STANDARD_SHANKS if size >= 0.999 * self.diameter), self.diameter)
        if self.shank_diameter is not None or shank <= 1.001 * self.diameter:
            return self
        flutes = self.flute_length if self.flute_length < self.stick_out else self.diameter
        return replace(self, shank_diameter=shank, flute_length=flutes)

    @property
    def frequency(self) -> float:
        """First natural frequency of the solid cantilever (Hz), above that of the clamped tool."""
        material = MATERIALS[self.material]
        speed = math.sqrt(material.youngs_modulus / material.density)
        return CANTILEVER_CONSTANT**2 * self.solid_diameter / 4 * speed / (2 * math.pi * self.stick_out**2)


def find_tool_beam(machine: Machine, name: str) -> ToolBeam | None:
    """Return a tool as a beam from its keys in machine.toml.

    Parameters
    ----------
    machine
        Machine with its tools and programs.
    name
        Name of the tool.

    Returns
    -------
    ToolBeam or None
        Beam; None if diameter, stick-out or material is missing, or the tool is too short for a beam.
    """
    tool, table = find_tool_properties(machine, name), machine.tool_table(name)
    of_table = None if table is None else table.stick_out_mm
    stick_out = machine.tap.conditions(name).stick_out_mm or of_table
    material = SHANK_MATERIALS.get(tool.tool_material) if tool.tool_material else None
    if tool.diameter_mm is None or stick_out is None or material is None:
        return None
    if stick_out < MIN_SLENDERNESS * tool.diameter_mm:
        return None
    flutes = stick_out if tool.flute_length_mm is None else tool.flute_length_mm
    of_shank = None if table is None else table.shank_diameter_mm
    shank = None if of_shank is None else of_shank / 1e3
    return ToolBeam(tool.diameter_mm / 1e3, stick_out / 1e3, flutes / 1e3, material, shank)


def compare_with_tool(modes: Sequence[Mode], tool: ToolBeam | None, highest_frequency: float) -> ToolAgreement:
    """Compare the static compliance at the tool tip with that of the tool alone.

    Modes above the measured band are missing in the sum. So only a band that reaches the first natural frequency of
    the clamped tool, which holds 97 % of its compliance, shows that a tip is too stiff.

    Parameters
    ----------
    modes
        Modes at the tool tip; those with a negative or unknown stiffness do not count.
    tool
        Tool; None if unknown.
    highest_frequency
        Upper end of the usable band (Hz).

    Returns
    -------
    ToolAgreement
        Agreement.

    Examples
    --------
    >>> tool = ToolBeam(diameter=0.016, stick_out=0.080, flute_length=0.080, material="carbide")
    >>> round(1e-6 / tool.compliance, 1)  # N/um
    4.5
    >>> compare_with_tool([Mode(1500.0, 0.02, 3.5e6)], tool, 4000.0).value
    'agrees'
    >>> compare_with_tool([Mode(1500.0, 0.02, 3 * 3.5e6)], tool, 4000.0).value
    'too stiff'
    """
    measured = sum_compliance(modes)
    if tool is None or not measured:
        return ToolAgreement.UNKNOWN
    if measured > TOOL_COMPLIANCE.limit * (tool.compliance + SUPPORT_COMPLIANCE):
        return ToolAgreement.TOO_SOFT
    if highest_frequency < tool.stiffest.frequency:
        return ToolAgreement.UNKNOWN
    is_stiff = measured < MIN_COMPLIANCE_RATIO * tool.stiffest.compliance
    return ToolAgreement.TOO_STIFF if is_stiff else ToolAgreement.AGREES


def has_plausible_size(compliance: float, tool: ToolBeam | None, highest_frequency: float) -> bool:
    """Tell whether the compliance at the tip is that of the tool, so that no sensitivity is wrong by a factor of 3.

    The true compliance is at least that of the tool alone, and at most that in a soft spindle. So three times the
    least and a third of the most must be outside of the accepted range. compliance: static at the tip (m/N); the others
    as of `compare_with_tool`. NaN is not plausible.
    """
    if tool is None or not highest_frequency >= tool.stiffest.frequency:
        return False
    least, most = MIN_COMPLIANCE_RATIO * tool.stiffest.compliance, tool.compliance + SUPPORT_COMPLIANCE
    limit = TOOL_COMPLIANCE.limit
    return max(least, most / limit) < compliance < limit * least


def sum_compliance(modes: Sequence[Mode]) -> float:
    """Return the sum of 1/K of the driving-point modes with a known stiffness (m/N), 0 without any."""
    return sum(1 / mode.stiffness for mode in modes if mode.stiffness > 0)


def check_tool_compliance(
    modes: Sequence[Mode], machine: Machine, tool_name: str, highest_frequency: float
) -> Remark | None:
    """Return the question about a tip that is stiffer or much softer than its tool allows, or None."""
    tool = find_tool_beam(machine, tool_name)
    if tool is None:
        return None
    credible = modal.select_credible_modes(modes).modes
    agreement = compare_with_tool(credible, tool, highest_frequency)
    if agreement in (ToolAgreement.AGREES, ToolAgreement.UNKNOWN):
        return None
    alone = tool.stiffest if agreement is ToolAgreement.TOO_STIFF else tool
    here, there = (
        format_rounded(1 / each, scale=1e6, digits=3) for each in (sum_compliance(credible), alone.compliance)
    )
    return TOOL_COMPLIANCE.ask(f"tool {tool_name!r}", measured=here, alone=there, agreement=agreement.value)
