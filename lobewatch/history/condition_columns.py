"""What tap tests were taken under as columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Conditions

NUMBERS = {"temperature_c": "degC", "stick_out_mm": "mm", "drawbar_kn": "kN"}
"""Their units; NaN where nobody said."""
TEXTS = ("state", "note")


def condition_columns(conditions: Sequence[Conditions]) -> dict[str, NDArray[Any]]:
    """A column each."""
    told = [one.known for one in conditions]
    numbers = {name: np.array([one.get(name, np.nan) for one in told], dtype=np.float64) for name in NUMBERS}
    texts = {name: np.array([one.get(name, "") for one in told], dtype=np.str_) for name in TEXTS}
    return {**numbers, **texts, "reclamped": np.array([one.reclamped for one in conditions], dtype=np.float64)}
