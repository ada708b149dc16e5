"""What the accelerometer does to the structure that it rides on, and to itself."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite
from typing import Literal, Self

Mounting = Literal["stud", "glue", "wax", "magnet", "hand"]
"""Ways to fix an accelerometer."""
SENSOR_DOUBT = 0.02
"""Standard error of the mass of the accelerometer, relative: as its data sheet says it, or weighed; chosen."""
CABLE_SHARE, CABLE_DOUBT = 0.5, 0.25
"""Share of the mass of the cable, up to where it is held, that moves along, and its standard error; chosen."""
MOST_GRAMS = 2000.0
"""Mass that no accelerometer has (g)."""


@dataclass(frozen=True)
class SensorLoading:
    """The accelerometer at the tip; ValueError for a mass that none has."""

    mass: float | None = None
    """Mass that moves along with the structure (kg); None where nobody said."""
    mass_std: float = 0.0
    """Standard error of that (kg)."""
    mounting: Mounting | Literal[""] | None = None
    """Way it is fixed; "" where nobody said, None where nobody is asked."""

    @classmethod
    def of(cls, sensor_g: float | None, cable_g: float = 0.0, mounting: Mounting | Literal[""] | None = None) -> Self:
        """From the masses of accelerometer and cable in grams."""
        if sensor_g is None:
            return cls(mounting=mounting)
        if not (isfinite(sensor_g) and 0 <= sensor_g <= MOST_GRAMS):
            raise ValueError(f"a sensor of {sensor_g:g} g: give its mass in g, 0 to {MOST_GRAMS:g}")
        std = hypot(SENSOR_DOUBT * sensor_g, CABLE_DOUBT * cable_g)
        return cls(1e-3 * (sensor_g + CABLE_SHARE * cable_g), 1e-3 * std, mounting)
