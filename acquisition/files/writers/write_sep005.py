"""SDyPy SEP005 time series: a list of dictionaries with data, name, unit_str and fs, as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence

from acquisition.files.writers.labels import Labels
from acquisition.hit import Hit


def sep005_of_hits(hits: Sequence[Hit], labels: Labels) -> bytes:
    """Force (N) and acceleration (m/s^2) of each hit, exactly; the group tells the hits apart."""
    texts = {"start_timestamp": labels.created.isoformat()} if labels.created else {}
    texts |= {key: value for key, value in (("direction", labels.direction), ("tool", labels.tool)) if value}
    channels = [
        {
            "name": name,
            "quantity": quantity,
            "unit_str": unit,
            "fs": hit.sample_rate,
            "group": f"hit {number}",
            **texts,
            "data": getattr(hit, name).tolist(),
        }
        for number, hit in enumerate(hits, 1)
        for name, quantity, unit in (("force", "f", "N"), ("acceleration", "a", "m/s^2"))
    ]
    return json.dumps(channels, allow_nan=False).encode("utf-8")
