"""SigLab (.vna, DSP Technology): a MATLAB file whose transfer functions are in volts over volts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from acquisition.files.contents.contents import Contents, Signal


def siglab(v: Mapping[str, Any]) -> Contents | None:
    """Its FRFs in the units of their channels; None where it is of another program.

    `SLm` holds the frequencies (fdxvec), a cell for each reference and response (xcmeas) and the channels (scmeas) with
    units for each volt (euscale_fac). That these are not yet in its transfer functions (xfer) is from public files: an
    accelerometer and a laser at one point agree with them, 0.9 to 1.1 in five of seven (docs/formats.md).
    """
    measured = v.get("SLm")
    if not isinstance(measured, Mapping) or not {"fdxvec", "xcmeas", "scmeas"} <= measured.keys():
        return None
    signals = tuple(_signals(measured))
    return Contents(signals, averages=int(measured.get("navg", 0)) or None) if len(signals) > 1 else None


def _signals(measured: Mapping[str, Any]) -> Iterator[Signal]:
    frequency = measured["fdxvec"]
    yield Signal("frequency", frequency, "frequency", "Hz")
    for reference, row in zip(measured["scmeas"], measured["xcmeas"], strict=False):
        for response, cell in zip(measured["scmeas"], row, strict=False):
            if np.shape(cell["xfer"]) == frequency.shape:
                (volts, below), (over, above) = _scale(reference), _scale(response)
                label = f"{response['label']} over {reference['label']}"
                yield Signal(label, cell["xfer"] * (over / volts), "frf", f"{above}/{below}")
            if np.shape(cell["coh"]) == frequency.shape:
                yield Signal("coherence", cell["coh"], "coherence")


def _scale(channel: Mapping[str, Any]) -> tuple[float, str]:
    """Units a volt, and the unit, of a channel."""
    return (float(channel["euscale_fac"]), f"({channel['eu_string']})") if channel["eu_on_off"] else (1.0, "V")
