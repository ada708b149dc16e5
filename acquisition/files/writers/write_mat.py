"""MATLAB v5 files: double precision, units beside the numbers."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from acquisition.errors import DataError
from acquisition.files.writers.labels import Labels, as_measured
from acquisition.frf import Frf
from acquisition.hit import Hit


def mat_of_frf(frf: Frf, labels: Labels) -> bytes:
    """frequency (Hz), frf with its unit, coherence, averages."""
    values, unit = as_measured(frf)
    variables: dict[str, Any] = {"frequency": frf.frequency, "frf": values, "unit": unit, "averages": frf.n_averages}
    if frf.coherence is not None:
        variables["coherence"] = frf.coherence
    return _mat(variables, labels)


def mat_of_hits(hits: Sequence[Hit], labels: Labels) -> bytes:
    """force (N) and acceleration (m/s^2), a row a hit, and sample_rate (Hz)."""
    if len({(hit.force.size, hit.sample_rate) for hit in hits}) > 1:
        raise DataError("the hits differ in length or sample rate; write them as .json")
    rows = {
        "force": np.stack([hit.force for hit in hits]),
        "acceleration": np.stack([hit.acceleration for hit in hits]),
    }
    return _mat({**rows, "sample_rate": hits[0].sample_rate}, labels)


def _mat(variables: dict[str, Any], labels: Labels) -> bytes:
    import scipy.io  # it takes a while, and few files need it

    texts = {
        "written_by": "lobewatch",
        "recorded": labels.created.isoformat() if labels.created else "",
        "direction": labels.direction,
        "tool": labels.tool,
        "window": labels.window,
    }
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, texts | variables, oned_as="column")
    return buffer.getvalue()
