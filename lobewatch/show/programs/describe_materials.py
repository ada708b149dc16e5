"""Materials with their cutting coefficients as JSON objects and as lines for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from lobes import Coefficients
from lobes.listed_materials import CHIP, CHIPS
from lobewatch.show.terminal.output import table

FEW = 5
"""Most materials whose sources are said."""


def material_json(known: Coefficients) -> dict[str, Any]:
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
        "chip_thickness_mm": CHIP * 1e3 if known.specific_forces else None,
        "specific_forces": [
            {"kc1_1_n_per_mm2": force.at_1_mm / 1e6, "mc": force.exponent, "source": force.source}
            for force in known.specific_forces
        ],
        "note": known.note,
        "source": known.source,
    }


def material_texts(known: Sequence[Coefficients]) -> Iterator[str | Table]:
    """A table of them, what its numbers are, and the sources of a few."""
    in_short = len(known) > FEW
    heads = "~material", "<ISO", "Kt\n(N/mm²)", "low..high", "Kr/Kt"
    rows = table(*heads, *([] if in_short else ["low..high", "Kte\n(N/mm)", "~also"]))
    for one in known:
        force = f"{one.tangential / 1e6:.0f}", _range(one.tangential_range, 1e6, 0)
        ratio = f"{one.radial / one.tangential:.2f}", _range(one.ratio_range, 1.0, 2)
        edge = "-" if math.isnan(one.tangential_edge) else f"{one.tangential_edge / 1e3:.0f}"
        cells = escape(one.material), one.iso_group or "-", *force, *ratio, edge, escape(", ".join(one.equivalents))
        rows.add_row(*(cells[: len(heads)] if in_short else cells))
    yield rows
    if not in_short:
        yield from (f"{one.material}: {'; '.join(filter(None, (one.note, one.source)))}" for one in known)
    else:
        yield "range of Kr/Kt, force at the edge, other names, sources: lobewatch materials NAME, or --json"
    if any(one.specific_forces for one in known):
        thin, thick = (f"{chip * 1e3:g}" for chip in CHIPS)
        yield (
            f"from kc1.1 and mc: Kt = (1 - mc) kc1.1 h^-mc and Kte = mc kc1.1 h^(1 - mc) at h = {CHIP * 1e3:g} mm, "
            f"the range over all publications and h = {thin} to {thick} mm (docs/lobes.md)"
        )


def _range(limits: tuple[float, float] | None, unit: float, digits: int) -> str:
    return "-" if limits is None else "..".join(f"{limit / unit:.{digits}f}" for limit in limits)
