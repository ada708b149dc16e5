"""Add remarks to the modes of an FRF whose stated quantity or unit is wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition import Frf
from acquisition.frf import FRF_UNITS, FrfQuantity
from modal.modes.mistaken_quantity import find_true_quantity, is_plausible_mass, median_modal_mass
from modal.modes.mode import Mode, add_remark
from modal.quality.trust import Trust, assess_trust

EXPLAINED_CODES = ("not-driving-point", "complex-mode")
"""Codes of remarks that a wrong quantity explains."""


def add_quantity_remarks(frf: Frf, modes: Sequence[Mode]) -> list[Mode]:
    """Add a remark to all modes of an FRF if its values are of another quantity or unit than stated.

    Remarks on signs and phases, which a wrong quantity explains, are left out. One doubtful mode decides nothing.
    """
    trusts = [assess_trust(mode) for mode in modes]
    known = [mode for mode, trust in zip(modes, trusts, strict=True) if trust is not Trust.REJECTED]
    if len(known) < 2 and Trust.TRUSTED not in trusts:
        return [*modes]
    true, mass = find_true_quantity(known, frf.measured_as), median_modal_mass(known)
    if true is None and is_plausible_mass(mass):
        return [*modes]
    phase = float(np.median([abs(mode.phase_deg) for mode in known]))
    return [
        _with_quantity_remark(mode, frf, true, f"median modal mass {mass:.1g} kg, phase {phase:.0f}°") for mode in modes
    ]


def _with_quantity_remark(mode: Mode, frf: Frf, true: FrfQuantity | None, figures: str) -> Mode:
    if true is None:
        text = f"unit of the FRF or sensitivity of a sensor is wrong ({figures})"
        cure = "Give the columns their unit with Description.columns, or correct the sensitivity"
        return add_remark(mode, "wrong-unit", text, cure)
    text = f"values look like {true}, not {frf.measured_as} ({figures})"
    cure = f"Give the columns their unit ({FRF_UNITS[true]}) with Description.columns"
    others = tuple(remark for remark in mode.remarks if remark.code not in EXPLAINED_CODES)
    return add_remark(replace(mode, remarks=others), "wrong-quantity", text, cure)
