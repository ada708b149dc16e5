"""The specific cutting force kc = kc1.1 h^-mc of Kienzle, h in mm, and what it says of small changes of h."""

from __future__ import annotations

from dataclasses import dataclass

MM = 1e-3
"""Chip thickness at which kc is kc1.1 (m)."""


@dataclass(frozen=True)
class SpecificForce:
    """Specific cutting force as a publication gives it, kc = kc1.1 h^-mc with the chip thickness h in mm.

    Source: Kienzle (1952), VDI-Z 94, 299.

    Kienzle's force per width kc1.1 h^(1 - mc) is Ktc h + Kte around one chip thickness:

    >>> steel = SpecificForce(at_1_mm=1500e6, exponent=0.25, source="")
    >>> ktc, kte = steel.tangential(0.1e-3), steel.tangential_edge(0.1e-3)
    >>> round(ktc / 1e6), round(kte / 1e3, 1)  # N/mm2, N/mm
    (2001, 66.7)
    >>> round((ktc * 0.1e-3 + kte) / 1e3, 1), round(1500 * 0.1**0.75, 1)  # N/mm
    (266.7, 266.7)
    """

    at_1_mm: float
    """kc1.1, the force per area of a chip 1 mm thick and 1 mm wide (Pa)."""
    exponent: float
    """mc, by which it falls with the thickness of the chip (-)."""
    source: str
    """Publication that both stand in."""

    def tangential(self, thickness: float) -> float:
        """Ktc (Pa): by how much the force per width grows with the chip thickness (m) around it, (1 - mc) kc."""
        return (1 - self.exponent) * self._at(thickness)

    def tangential_edge(self, thickness: float) -> float:
        """Kte (N/m): what the force per width has beside Ktc h at this chip thickness (m), mc kc h."""
        return self.exponent * self._at(thickness) * thickness

    def _at(self, thickness: float) -> float:
        return self.at_1_mm * float((thickness / MM) ** -self.exponent)
