"""Text tables with commas and a heading: all 17 digits of every number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.writers.labels import Labels, as_measured
from acquisition.frf import Frf
from acquisition.hit import Hit


def table_of_frf(frf: Frf, labels: Labels) -> bytes:
    """Frequency, real and imaginary part, coherence where there is one."""
    values, unit = as_measured(frf)
    columns = {"frequency [Hz]": frf.frequency, f"real [{unit}]": values.real, f"imag [{unit}]": values.imag}
    if frf.coherence is not None:
        columns["coherence"] = frf.coherence
    return _table(columns, labels, averages=frf.n_averages)


def table_of_hits(hits: Sequence[Hit], labels: Labels) -> bytes:
    """Time, force and acceleration of one hit; DataError for several."""
    if len(hits) != 1:
        raise DataError(f"{len(hits)} hits: a text table holds one; write them as .uff, .mat or .json, or the FRF")
    (hit,) = hits
    time = np.arange(hit.force.size) / hit.sample_rate
    return _table({"time [s]": time, "force [N]": hit.force, "acceleration [m/s^2]": hit.acceleration}, labels)


def _table(columns: dict[str, NDArray[np.float64]], labels: Labels, averages: int | None = None) -> bytes:
    keys = {
        "written by": "lobewatch",
        "recorded": labels.created.isoformat() if labels.created else "",
        "direction": labels.direction,
        "tool": labels.plain_tool,
        "window": labels.window.replace("none", ""),
        "averages": "" if averages is None else str(averages),
        "rows": str(next(iter(columns.values())).size),
    }
    lines = [f"# {key}: {value}" for key, value in keys.items() if value]
    lines.append(",".join(columns))
    lines += [",".join(map(repr, row)) for row in zip(*(column.tolist() for column in columns.values()), strict=True)]
    return ("\n".join(lines) + "\n").encode("utf-8")
