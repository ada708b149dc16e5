"""Spindle at speed as learned from test cuts, used in verdicts with the tool as tapped."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import msgspec
import numpy as np

from acquisition import Remark
from lobewatch.arrays import Floats
from lobewatch.machine import CutTable
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.principal_directions import TipModes
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty, scale_fields

AnyCutTable = TypeVar("AnyCutTable", bound=CutTable)


@dataclass(frozen=True, eq=False)
class SpindleAtSpeed:
    """Spindle at speed, as learned from the test cuts of a program; without any, the spindle as tapped."""

    n_cuts: int = 0
    """Number of test cuts that it was learned from."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on rejected cuts and unusual frequencies."""
    uncertainty: Uncertainty | None = None
    """Uncertainty after the cuts; None if nothing was learned."""
    factors: Floats = field(default_factory=lambda: np.ones((0, 3)))
    """Frequency, damping ratio and stiffness in the median over those tapped, modes in x, then y, shape (n, 3)."""
    tangential: float = math.nan
    """Cutting coefficient Kt in the learned median (N/mm2)."""
    radial: float = math.nan
    """Cutting coefficient Kr in the learned median (N/mm2)."""
    prior_ranges: Mapping[str, FactorRange] = field(default_factory=dict)
    """95 % intervals before the cuts, over the values not rotating, by name ("frequency_x", "tangential", ...)."""
    posterior_ranges: Mapping[str, FactorRange] = field(default_factory=dict)
    """95 % intervals with the cuts, by the same names."""

    def scale_modes(self, assembly: Assembly) -> Assembly:
        """Scale the modes of a tool to the learned median; unchanged where nothing was learned.

        Parameters
        ----------
        assembly
            Tool as tapped.

        Returns
        -------
        Assembly
            Tool with the learned modes.
        """
        if self.uncertainty is None:
            return assembly
        count = len(assembly.x or ())
        x, y = _scale_modes(assembly.x, self.factors[:count]), _scale_modes(assembly.y, self.factors[count:])
        return replace(assembly, x=x, y=y)

    def apply_coefficients(self, table: AnyCutTable) -> AnyCutTable:
        """Set the learned cutting coefficients of a cut; unchanged where none were learned.

        Parameters
        ----------
        table
            Program or cut as in machine.toml.

        Returns
        -------
        ProgramTable or CutTable
            The same with the learned Kt and Kr.
        """
        if self.uncertainty is None:
            return table
        return msgspec.structs.replace(table, tangential_n_per_mm2=self.tangential, radial_n_per_mm2=self.radial)


NO_TEST_CUTS = SpindleAtSpeed()
"""Nothing learned: the spindle is evaluated as it was tapped."""


def _scale_modes(modes: TipModes, factors: Floats) -> TipModes:
    """Scale frequency, damping ratio and stiffness of modes by factors (n, 3)."""
    unfitted = [replace(mode, covariance=None, jackknife=None, n_hits=0) for mode in modes or ()]
    pairs = zip(unfitted, factors.tolist(), strict=True)
    return modes and [scale_fields(mode, frequency=f, damping_ratio=zeta, stiffness=k) for mode, (f, zeta, k) in pairs]
