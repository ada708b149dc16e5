"""LSCF poles of every order, and which of them are modes."""

from .physical_poles import PhysicalPoles, physical_poles
from .stabilise import StabilisationChart, stabilise

__all__ = ["PhysicalPoles", "StabilisationChart", "physical_poles", "stabilise"]
