"""The specific cutting force kc = kc1.1 h^-mc of Kienzle, h in mm, and what it says of small changes of h."""

from __future__ import annotations

from dataclasses import dataclass

MM = 1e-3
"""Chip thickness at which kc is kc1.1 (m)."""


@dataclass(frozen=True)
class SpecificForce:
    """Specific cutting force as a publication gives it."""

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
