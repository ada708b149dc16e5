"""Show materials with their cutting coefficients, and the measured power of a cut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from lobes import Cut, CuttingCoefficients
from lobes.materials import CHIP_THICKNESS_RANGE, REFERENCE_CHIP_THICKNESS
from lobewatch.machine.settings.drive_power import CutPower
from lobewatch.show.terminal.output import new_table

MAX_MATERIALS_IN_FULL = 5
"""Most materials whose sources are said."""


def material_json(known: CuttingCoefficients) -> dict[str, Any]:
    """One material; ranges are [lowest, highest], null where no spread is published."""
    return {
        "name": known.material,
        "iso_group": known.iso_group,
        "equivalents": known.equivalents,
        "kt_n_per_mm2": known.tangential / 1e6,
        "kt_range_n_per_mm2": known.tangential_range and [limit / 1e6 for limit in known.tangential_range],
        "kr_n_per_mm2": known.radial / 1e6,
        "kr_over_kt": known.radial / known.tangential,
        "kr_over_kt_range": known.ratio_range,
        "kte_n_per_mm": known.tangential_edge / 1e3,
        "kre_n_per_mm": known.radial_edge / 1e3,
        "chip_thickness_mm": REFERENCE_CHIP_THICKNESS * 1e3 if known.specific_forces else None,
        "specific_forces": [
            {"kc1_1_n_per_mm2": force.at_1_mm / 1e6, "mc": force.exponent, "source": force.source}
            for force in known.specific_forces
        ],
        "note": known.note,
        "source": known.source,
    }


def material_texts(known: Sequence[CuttingCoefficients]) -> Iterator[str | Table]:
    """A table of them, what its numbers are, and the sources of a few."""
    in_short = len(known) > MAX_MATERIALS_IN_FULL
    heads = "~material", "<ISO", "Kt\n(N/mm²)", "low..high", "Kr/Kt"
    rows = new_table(*heads, *([] if in_short else ["low..high", "Kte\n(N/mm)", "~also"]))
    for one in known:
        force = f"{one.tangential / 1e6:.0f}", _range_text(one.tangential_range, 1e6, 0)
        ratio = f"{one.radial / one.tangential:.2f}", _range_text(one.ratio_range, 1.0, 2)
        edge = "-" if math.isnan(one.tangential_edge) else f"{one.tangential_edge / 1e3:.0f}"
        cells = escape(one.material), one.iso_group or "-", *force, *ratio, edge, escape(", ".join(one.equivalents))
        rows.add_row(*(cells[: len(heads)] if in_short else cells))
    yield rows
    if not in_short:
        yield from (f"{one.material}: {'; '.join(filter(None, (one.note, one.source)))}" for one in known)
    else:
        yield "range of Kr/Kt, force at the edge, other names, sources: lobewatch materials NAME, or --json"
    if any(one.specific_forces for one in known):
        thin, thick = (f"{chip * 1e3:g}" for chip in CHIP_THICKNESS_RANGE)
        yield (
            f"from kc1.1 and mc: Kt = (1 - mc) kc1.1 h^-mc and Kte = mc kc1.1 h^(1 - mc) at h = {REFERENCE_CHIP_THICKNESS * 1e3:g} mm, "
            f"the range over all publications and h = {thin} to {thick} mm (docs/lobes.md)"
        )


def _range_text(limits: tuple[float, float] | None, unit: float, digits: int) -> str:
    return "-" if limits is None else "..".join(f"{limit / unit:.{digits}f}" for limit in limits)


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
