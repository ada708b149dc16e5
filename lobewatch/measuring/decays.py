"""Hits whose force nobody measured, as what their modes are extracted from."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition import Hit, Remark, free_decay
from lobewatch.machine.settings.sensor_loading import SensorLoading
from lobewatch.measuring.sensor_remarks import mass_stays
from modal import Extraction, decay_spectra, extract

WITHOUT_FORCE = "force-not-measured"
"""Code of the remark on a tap test of free decays, which tell no stiffness."""
HIGHEST = 0.4
"""Share of the sample rate up to which the spectra of decays are used: beyond it filters and aliases begin."""


def extract_decays(hits: Sequence[Hit], band: tuple[float, float] | None = None) -> Extraction:
    """Modes of hits without force, which `modal.modes_of_decays` reads; band (Hz), None: up to HIGHEST."""
    rate, decays = hits[0].sample_rate, [free_decay(hit) for hit in hits]
    shortest = min(map(len, decays))
    return extract(decay_spectra([decay[:shortest] for decay in decays], rate), band or (0.0, HIGHEST * rate))


def about_decays(sensor: SensorLoading) -> list[Remark]:
    """Remarks on what free decays do not tell; the mass of the sensor stays in them, for what it does needs K."""
    text = "no force was measured: frequency and damping are known, stiffness is not; no stability lobes, no depths"
    remark = Remark(WITHOUT_FORCE, "", text, "tap with a hammer that measures its force")
    return [remark, *([mass_stays(sensor, "what they do needs K")] if sensor.mass else [])]
