"""[doubt]: what is not known, as half-widths; all of it has a default."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from lobewatch.machine.settings.cut_tables import Wear
from lobewatch.machine.settings.toml_table import Table

Percent = Annotated[float, Meta(ge=0, le=100)]


class DoubtTable(Table, frozen=True):
    """Half-widths (%) of independent uniform distributions. docs/lobes.md says where the defaults come from."""

    frequency_percent: Percent | None = None
    """Natural frequency from tap test to tap test; None: the series' own scatter from 8 tests on, before that 0.3."""
    damping_percent: Percent | None = None
    """Damping ratio from tap test to tap test; None: likewise, before that 10."""
    stiffness_percent: Percent | None = None
    """Modal stiffness from tap test to tap test; None: likewise, before that 3."""
    speed_percent: Percent = 1.0
    """Spindle speed."""
    coefficients_percent: Percent = 20.0
    """Cutting coefficients and their ratio, where no published range is known."""
    predicted_frequency_percent: Percent = 3.0
    """Natural frequencies of a tool that was never tapped."""
    predicted_damping_percent: Percent = 30.0
    """Damping ratios of such a tool."""
    predicted_stiffness_percent: Percent = 15.0
    """Modal stiffnesses of such a tool."""
    untapped_frequency_percent: Percent = 5.0
    """Natural frequencies in a direction that was not tapped, against the other one."""
    untapped_stiffness_percent: Percent = 30.0
    """Modal stiffnesses in such a direction."""
    wear: Wear = "new"
    """How worn tools may be; a program may say otherwise."""
