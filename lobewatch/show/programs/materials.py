"""Show materials with their cutting coefficients, and the measured power of a cut."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from rich.markup import escape
from rich.table import Table

from acquisition.errors import join_sentences
from lobes import Cut, CuttingCoefficients
from lobes.materials import CHIP_THICKNESS_RANGE, REFERENCE_CHIP_THICKNESS, find_joint_coefficients
from lobewatch.machine.settings.drive_power import CutPower
from lobewatch.show.terminal.output import JsonObject, new_table, pick

MAX_MATERIALS_IN_FULL = 5
"""Largest number of materials that are shown with their sources."""
JOINT_PROBABILITIES = np.array([0.05, 0.5, 0.95])
"""Probabilities of the shown quantiles of Kt and Kr/Kt."""


def material_json(material: CuttingCoefficients) -> JsonObject:
    """Return one material; a range is [lowest, highest], or None without a published spread."""
    spread = material.tangential_range
    forces = [
        {"kc1_1_n_per_mm2": kc.at_1_mm / 1e6, "mc": kc.exponent, "source": kc.source} for kc in material.specific_forces
    ]
    return {
        "name": material.material,
        **pick(material, "iso_group", "equivalents"),
        "kt_n_per_mm2": material.tangential / 1e6,
        "kt_range_n_per_mm2": spread and [kt / 1e6 for kt in spread],
        "kr_n_per_mm2": material.radial / 1e6,
        "kr_over_kt": material.radial / material.tangential,
        "kr_over_kt_range": material.ratio_range,
        "joint": _joint_json(material),
        "kte_n_per_mm": material.tangential_edge / 1e3,
        "kre_n_per_mm": material.radial_edge / 1e3,
        "chip_thickness_mm": REFERENCE_CHIP_THICKNESS * 1e3 if forces else None,
        "specific_forces": forces,
        **pick(material, "note", "source"),
    }


def _joint_json(material: CuttingCoefficients) -> JsonObject | None:
    """Return quantiles and correlation of Kt and Kr/Kt, None without a joint distribution."""
    joint = find_joint_coefficients(material)
    if joint is None:
        return None
    return {
        "probabilities": JOINT_PROBABILITIES.tolist(),
        "kt_n_per_mm2": (joint.tangential.at(JOINT_PROBABILITIES) / 1e6).tolist(),
        "kr_over_kt": joint.ratio.at(JOINT_PROBABILITIES).tolist(),
        "rank_correlation": joint.correlation,
    }


def _joint_text(material: CuttingCoefficients) -> Iterator[str]:
    """Yield the 90 % intervals of Kt and Kr/Kt, if there is a joint distribution."""
    joint = find_joint_coefficients(material)
    if joint is not None:
        (low, _, high), (least, _, most) = (each.at(JOINT_PROBABILITIES) for each in (joint.tangential, joint.ratio))
        force, ratio = f"Kt {low / 1e6:.0f}..{high / 1e6:.0f} N/mm²", f"Kr/Kt {least:.2f}..{most:.2f}"
        yield f"{material.material}, 90 % intervals: {force}, {ratio}. Rank correlation {joint.correlation:g}."


def material_texts(materials: Sequence[CuttingCoefficients]) -> Iterator[str | Table]:
    """Return a table of materials with a note on its numbers, and the sources of a few materials."""
    is_short = len(materials) > MAX_MATERIALS_IN_FULL
    headings = "~material", "<ISO", "Kt\n(N/mm²)", "low..high", "Kr/Kt", "low..high", "Kte\n(N/mm)", "~other names"
    n_columns = 5 if is_short else len(headings)
    yield new_table(*headings[:n_columns], rows=(_material_cells(material)[:n_columns] for material in materials))
    if is_short:
        yield "Range of Kr/Kt, Kte, other names and sources: lobewatch materials NAME, or --json"
    else:
        for one in materials:
            yield f"{one.material}: {join_sentences(one.note, one.source)}"
            yield from _joint_text(one)
    if any(material.specific_forces for material in materials):
        thin, thick = (f"{chip * 1e3:g}" for chip in CHIP_THICKNESS_RANGE)
        yield (
            "Values from kc1.1 and mc: Kt = (1 - mc) kc1.1 h^-mc and Kte = mc kc1.1 h^(1 - mc) "
            f"at h = {REFERENCE_CHIP_THICKNESS * 1e3:g} mm."
        )
        yield f"Ranges cover all publications and h = {thin} to {thick} mm (docs/materials.md)."


def _material_cells(material: CuttingCoefficients) -> list[str]:
    edge = material.tangential_edge
    tangential = f"{material.tangential / 1e6:.0f}", _range_text(material.tangential_range, 1e6, 0)
    ratio = f"{material.radial / material.tangential:.2f}", _range_text(material.ratio_range, 1.0, 2)
    others = "-" if math.isnan(edge) else f"{edge / 1e3:.0f}", escape(", ".join(material.equivalents))
    return [escape(material.material), material.iso_group or "-", *tangential, *ratio, *others]


def _range_text(limits: tuple[float, float] | None, unit: float, digits: int) -> str:
    return "-" if limits is None else "..".join(f"{limit / unit:.{digits}f}" for limit in limits)


def power_text(power: CutPower, cut: Cut) -> str:
    """Return the power of a cut, its Kt, and that of machine.toml."""
    by_power, known = power.tangential / 1e6, cut.tangential / 1e6
    return (
        f"from {power.watts / 1e3:.4g} kW of drive power: Kt {by_power:.0f} N/mm2 (in machine.toml: {known:.0f} N/mm2)"
    )


def power_json(power: CutPower | None) -> JsonObject:
    """Return the power of a cut and its Kt, None without a power."""
    kilowatts, tangential = (None, None) if power is None else (power.watts / 1e3, power.tangential / 1e6)
    return {"power_kw": kilowatts, "tangential_by_power_n_per_mm2": tangential}
