"""LSCF poles of every order, and which of them are modes."""

from modal.poles.physical_poles import PhysicalPoles, physical_poles
from modal.poles.stabilise import StabilisationChart, stabilise

__all__ = ["PhysicalPoles", "StabilisationChart", "physical_poles", "stabilise"]
