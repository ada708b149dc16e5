"""Cutting-force coefficients of one material."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SpecificForce:
    """Published specific cutting force by Kienzle, kc = kc1.1 h^-mc with the chip thickness h in mm.

    References
    ----------
    Kienzle (1952), VDI-Z 94, 299.

    Examples
    --------
    Kienzle's force per width kc1.1 h^(1 - mc) is Ktc h + Kte around one chip thickness:

    >>> steel = SpecificForce(at_1_mm=1500e6, exponent=0.25, source="")
    >>> ktc, kte = steel.tangential(0.1e-3), steel.tangential_edge(0.1e-3)
    >>> round(ktc / 1e6), round(kte / 1e3, 1)  # N/mm2, N/mm
    (2001, 66.7)
    >>> round((ktc * 0.1e-3 + kte) / 1e3, 1), round(1500 * 0.1**0.75, 1)  # N/mm
    (266.7, 266.7)
    """

    at_1_mm: float
    """Force kc1.1 per area of a chip 1 mm thick and 1 mm wide (Pa)."""
    exponent: float
    """Exponent mc of the decrease with chip thickness (-)."""
    source: str
    """Publication of both."""

    def tangential(self, thickness: float) -> float:
        """Return Ktc, the slope of the force per width over chip thickness: (1 - mc) kc.

        Parameters
        ----------
        thickness : float
            Chip thickness (m).

        Returns
        -------
        float
            Ktc (Pa).
        """
        return (1 - self.exponent) * self._at(thickness)

    def tangential_edge(self, thickness: float) -> float:
        """Return Kte, the part of the force per width beyond Ktc h: mc kc h.

        Parameters
        ----------
        thickness : float
            Chip thickness (m).

        Returns
        -------
        float
            Kte (N/m).
        """
        return self.exponent * self._at(thickness) * thickness

    def _at(self, thickness: float) -> float:
        return self.at_1_mm * float((thickness / 1e-3) ** -self.exponent)


@dataclass(frozen=True)
class CuttingCoefficients:
    """Cutting-force coefficients of one material: cutting force per chip area, edge force per edge length.

    Raises
    ------
    ValueError
        For coefficients that are not finite or not positive.

    Examples
    --------
    >>> material = find_materials("7075-T6")[0]
    >>> f"Ktc {material.tangential / 1e6:.0f} N/mm2, Krc {material.radial / 1e6:.0f} N/mm2"
    'Ktc 767 N/mm2, Krc 169 N/mm2'
    >>> material.source
    'Chinese J. Mech. Eng. 2021, 10.1186/s10033-021-00536-9, Table 5 ref. 190'
    """

    material: str
    """Material, tool and coolant, e.g. "Al 7075-T6 (carbide; dry)"."""
    tangential: float
    """Tangential coefficient Ktc (Pa)."""
    radial: float
    """Radial coefficient Krc (Pa)."""
    tangential_edge: float = float("nan")
    """Tangential edge coefficient Kte (N/m), which affects torque but not stability; nan if not published."""
    radial_edge: float = float("nan")
    """Radial edge coefficient Kre (N/m); nan if not published."""
    note: str = ""
    """Note on the use of the coefficients."""
    source: str = ""
    """Publication."""
    alloy: str = ""
    """Material without temper, tool and coolant, e.g. "Al 7075"; empty if unknown."""
    iso_group: str = ""
    """Group of ISO 513: P, M, K, N, S or H; empty if unknown."""
    vdi_3323_group: str = ""
    """Group of VDI 3323: 1 to 41; empty if unknown."""
    equivalents: tuple[str, ...] = ()
    """Other names of the material: EN number, AISI, UNS ..."""
    tangential_range: tuple[float, float] | None = None
    """Lowest and highest published Ktc (Pa); None if no spread is published."""
    ratio_range: tuple[float, float] | None = None
    """Lowest and highest published Krc/Ktc (-); None if no spread is published."""
    specific_forces: tuple[SpecificForce, ...] = ()
    """Published specific cutting forces behind the coefficients; empty if they were measured directly."""

    def __post_init__(self) -> None:
        """Check the coefficients."""
        check_coefficients(self.tangential, self.radial)

    @property
    def names(self) -> tuple[str, ...]:
        """All names of the material."""
        return (self.material, *self.equivalents)


def check_coefficients(tangential: float, radial: float) -> None:
    """Raise ValueError unless Ktc is > 0 and Krc >= 0, both finite (Pa)."""
    check_number("tangential", tangential, "Pa is not a finite number > 0 (1 N/mm^2 is 1e6 Pa)")
    check_number("radial", radial, "Pa is not a finite number >= 0 (1 N/mm^2 is 1e6 Pa)", may_be_zero=True)


def check_number(name: str, value: float, text: str, may_be_zero: bool = False) -> None:
    """Raise ValueError with this text unless a value is finite and > 0, or 0 where that is allowed."""
    if not (np.isfinite(value) and (value >= 0 if may_be_zero else value > 0)):
        raise ValueError(f"{name}={value} {text}")


def tangential_and_radial(specific_force: float, force_angle: float) -> tuple[float, float]:
    """Split a specific cutting force: Ktc = Ks sin(beta), Krc = Ks cos(beta).

    `Cut.specific_force` and `Cut.force_angle` are the way back.

    Parameters
    ----------
    specific_force : float
        Specific cutting force Ks (Pa).
    force_angle : float
        Angle beta between cutting force and surface normal (rad), in (0, pi/2].

    Returns
    -------
    tuple of float
        Ktc and Krc (Pa).

    Raises
    ------
    ValueError
        For Ks <= 0 or beta outside (0, pi/2].

    Examples
    --------
    >>> ktc, krc = tangential_and_radial(750e6, np.radians(68.0))
    >>> round(float(ktc) / 1e6, 1), round(float(krc) / 1e6, 1)  # N/mm2
    (695.4, 281.0)
    """
    check_number("specific_force", specific_force, "Pa is not a finite number > 0 (1 N/mm^2 is 1e6 Pa)")
    if not 0 < force_angle <= np.pi / 2:
        raise ValueError(f"force_angle={force_angle} rad is not in (0, pi/2] (68 degrees are 1.187 rad)")
    return specific_force * float(np.sin(force_angle)), max(specific_force * float(np.cos(force_angle)), 0.0)
