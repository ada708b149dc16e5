"""pyuff, another program for universal files: it reads what we write, we read what it writes."""

from __future__ import annotations

import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import Frf, from_accelerance, inspect_file
from acquisition.files.convert import ExportLabels, encode_uff_frf

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import pyuff

F = np.arange(0.5, 200.0, 0.5)
H = 1e-7 / (1 - (F / 80) ** 2 + 0.04j * F / 80)


def uneven(frf: Frf) -> Frf:
    keep = np.r_[0:50, 60 : frf.frequency.size]
    coherence = None if frf.coherence is None else frf.coherence[keep]
    return Frf(frf.frequency[keep], frf.receptance[keep], coherence, frf.n_averages)


@pytest.mark.parametrize("even", [True, False])
def test_it_reads_what_we_write(tmp_path: Path, even: bool) -> None:
    frf = Frf(F, np.asarray(H, dtype=np.complex128), np.linspace(0, 1, F.size), 12)
    frf = frf if even else uneven(frf)
    path = tmp_path / "ours.uff"
    path.write_bytes(encode_uff_frf(frf, ExportLabels(datetime(2024, 5, 1, 9, 30, tzinfo=UTC), "y", "cutter")))
    sets = pyuff.UFF(str(path)).read_sets()
    assert [one["type"] for one in sets] == [151, 164, 58, 58]
    assert (sets[1]["units_code"], sets[1]["length"], sets[1]["force"]) == (1, 1.0, 1.0)
    h, coherence = sets[2:]
    assert (h["func_type"], coherence["func_type"]) == (4, 6)
    assert (h["rsp_dir"], h["ref_dir"], h["ordinate_spec_data_type"], h["orddenom_spec_data_type"]) == (2, 2, 8, 13)
    assert (h["ordinate_axis_units_lab"].strip(), h["orddenom_axis_units_lab"].strip()) == ("m", "N")
    assert np.asarray(h["x"]) == pytest.approx(frf.frequency, rel=6e-6)
    assert np.asarray(h["data"]) == pytest.approx(frf.receptance, rel=1e-11)
    assert np.asarray(coherence["data"]) == pytest.approx(frf.coherence, rel=1e-11)


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("even", [0, 1])
def test_we_read_what_it_writes(tmp_path: Path, binary: int, even: int) -> None:
    frf = from_accelerance(F, -((2 * np.pi * F) ** 2) * H)
    frf = frf if even else uneven(frf)
    accelerance = frf.accelerance / 9.80665
    made: dict[str, Any] = pyuff.prepare_58(
        binary=binary,
        ver_num=1,
        load_case_id=0,
        func_type=4,
        rsp_node=3,
        rsp_dir=-1,
        ref_node=3,
        ref_dir=1,
        id1="Fräser",
        id3="01-May-24 09:30:00",
        data=accelerance,
        x=frf.frequency,
        abscissa_inc=0.5,
        abscissa_min=0.5,
        abscissa_spacing=even,
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
        ordinate_axis_units_lab="g",
        orddenom_spec_data_type=13,
        orddenom_axis_units_lab="N",
    )
    path = tmp_path / "theirs.uff"
    pyuff.UFF(str(path)).write_sets(made, "add")
    found = inspect_file(path).require_valid()
    assert found.frf is not None
    assert found.frf.frequency == pytest.approx(frf.frequency, rel=1e-6)
    assert found.frf.receptance == pytest.approx(-frf.receptance, rel=5e-6)
    assert found.direction == "x"
    assert f"{found.created:%Y-%m-%d %H:%M}" == "2024-05-01 09:30"
