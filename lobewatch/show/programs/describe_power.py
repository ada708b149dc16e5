"""Power of a cut, for people and as JSON."""

from __future__ import annotations

from typing import Any

from lobes import Cut
from lobewatch.machine.settings.cut_power import CutPower


def power_text(power: CutPower, cut: Cut) -> str:
    """A power, and the Kt that it says beside that which the cut was taken for."""
    by_power, known = power.tangential / 1e6, cut.tangential / 1e6
    return f"{power.watts / 1e3:.4g} kW say Kt {by_power:.0f} N/mm2, machine.toml {known:.0f}"


def power_json(power: CutPower | None) -> dict[str, Any]:
    """The same; None where nobody has read it."""
    return {
        "power_kw": None if power is None else power.watts / 1e3,
        "tangential_by_power_n_per_mm2": None if power is None else power.tangential / 1e6,
    }
