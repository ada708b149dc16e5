"""Arrays as Python users and MATLAB keep them: .npy, .npz, HDF5 of any paths, matrices without an axis."""

from __future__ import annotations

import contextlib
import re
import struct
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition import DataError, Description, Frf, inspect_file, read_frf, read_hits

F = np.arange(1.0, 60.0)
H = 1e-6 / (1 + 0.1j * F)


def is_h(frf: Frf, of: np.ndarray[Any, Any] = H) -> bool:
    return np.allclose(frf.receptance, of, rtol=1e-9, atol=0) and np.allclose(frf.frequency, F)


def complaint(path: Path, **said: object) -> str:
    return inspect_file(path, Description(**said)).problems  # type: ignore[arg-type]


def hdf5(path: Path, **arrays: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name.replace("__", "/")] = values
    return path


def npz(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def test_one_complex_array_asks_for_unit_and_spacing_at_once(tmp_path: Path) -> None:
    np.save(tmp_path / "H.npy", H)
    said = complaint(tmp_path / "H.npy")
    assert re.findall(r"\(.*?\)", said) == [
        "(give Description.unit, for example m/N, um/N or g/N)",
        "(give Description.spacing, for example 0.5 Description.start 0 in Hz)",
    ]
    assert is_h(read_frf(tmp_path / "H.npy", Description(unit="m/N", spacing=1.0, start=1.0)))


@pytest.mark.parametrize("shape", [(3, 59), (59, 3), (1, 3, 59)])
def test_of_several_frfs_one_is_chosen(tmp_path: Path, shape: tuple[int, ...]) -> None:
    rows = np.array([H, 2 * H, 3 * H])
    np.save(tmp_path / "H.npy", rows.T if shape[0] == 59 else rows.reshape(shape))
    assert "3 FRFs: 1 array:1, 2 array:2, 3 array:3 (give Description.response, for example 1)" in complaint(
        tmp_path / "H.npy"
    )
    said = Description(unit="m/N", spacing=1.0, start=1.0, response=2)
    assert is_h(read_frf(tmp_path / "H.npy", said), 2 * H)


def test_fields_and_hits(tmp_path: Path) -> None:
    time = np.arange(400) / 4000
    hit = np.zeros(400, [("t", "f8"), ("force", "f4"), ("acc", "f4")])
    hit["t"], hit["force"][20:24], hit["acc"][22:] = time, 50.0, np.sin(np.arange(378))
    np.save(tmp_path / "hit.npy", hit)
    assert "unit of force (give Description.force_unit" in complaint(tmp_path / "hit.npy")
    said = Description(columns=("time [s]", "force [N]", "acceleration [g]"))
    assert read_hits(tmp_path / "hit.npy", said)[0].sample_rate == pytest.approx(4000)
    np.save(tmp_path / "rows.npy", np.stack([hit["force"], hit["acc"]]))
    said = Description(columns=("force [N]", "acceleration [g]"), rate=4000.0)
    assert read_hits(tmp_path / "rows.npy", said)[0].force == pytest.approx(hit["force"])


@pytest.mark.parametrize("make", [npz, hdf5])
def test_names_that_are_known_need_a_unit_alone(tmp_path: Path, make: Any) -> None:
    path = make(tmp_path / ("a.npz" if make is npz else "a.h5"), freq=F, H=H, coherence=np.full(59, 0.9))
    assert re.findall(r"\S+ \(.*?\)", complaint(path)) == ["H (give Description.unit, for example m/N, um/N or g/N)"]
    frf = read_frf(path, Description(unit="m/N"))
    assert is_h(frf)
    assert frf.coherence == pytest.approx(0.9)


@pytest.mark.parametrize("suffix", [".h5", ".hdf5"])
def test_data_sets_of_hdf5_by_path(tmp_path: Path, suffix: str) -> None:
    path = hdf5(
        tmp_path / f"a{suffix}",
        test__lines=F,
        test__points__p1=H,
        test__points__p2=2 * H,
        test__who="me",
        when=[b"now"],
    )
    said = complaint(path)
    assert "2 FRFs: 1 test/points/p1, 2 test/points/p2" in said
    assert 'Description.columns, for example "frequency [Hz]=test/lines,frf=test/points/p1"' in said
    columns = ("frequency [Hz]=test/lines", "frf [m/N]=test/points/p2")
    assert is_h(read_frf(path, Description(columns=columns)), 2 * H)
    content = path.read_bytes()
    for end in (9, 100, len(content) // 2):
        path.write_bytes(content[:end])
        with pytest.raises(DataError, match=f"a{suffix}: damaged"):
            inspect_file(path)


def test_a_matrix_of_matlab_without_an_axis(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"H21": np.stack([H.real, H.imag], axis=1), "df": 1.0})
    said = complaint(path)
    assert "columns H21:1, H21:2 (give Description.columns" in said
    assert "Description.spacing" in said
    columns = ("real [m/N]=H21:1", "imag=H21:2")
    assert is_h(read_frf(path, Description(columns=columns, spacing=1.0, start=1.0)))
    scipy.io.savemat(path, {"FRF": np.stack([2 * np.pi * F, H], axis=1)})  # an axis of complex type
    said = complaint(path)
    assert "unit of FRF:2 (give Description.unit" in said
    assert 'Description.columns, for example "frequency [Hz]=FRF:1,frf=FRF:2"' in said
    assert is_h(read_frf(path, Description(columns=("frequency [rad/s]=FRF:1", "frf [m/N]=FRF:2"))))


def test_what_stands_next_to_signals_over_time_can_be_named(tmp_path: Path) -> None:
    path, time = tmp_path / "a.mat", np.arange(200.0)
    scipy.io.savemat(path, {"t": time, "u": time, "y": time, "w": 2 * np.pi * F, "ts": H, "fs": 1.0, "k": np.eye(2)})
    assert 'Description.columns, for example "frequency [Hz]=w,frf=ts"' in complaint(path)
    assert is_h(read_frf(path, Description(columns=("frequency [rad/s]=w", "frf [m/N]=ts"))))
    poles = np.array([-1 + 9j, -1 - 9j])
    scipy.io.savemat(path, {"fs": 1.0, "u": time, "y": time, "poles": poles})
    assert "columns u (200), y (200), poles (2) (give Description.columns" in complaint(path)
    scipy.io.savemat(path, {"fs": 1.0, "u": time, "force": time, "w": 2 * np.pi * F, "ts": H})
    said = complaint(path)
    assert f"u (200), force (200), w ({F.size}), ts ({F.size})" in said
    assert "differ in length" not in said
    assert is_h(read_frf(path, Description(columns=("frequency [rad/s]=w", "frf [m/N]=ts"))))


def test_siglab_has_volts_over_volts_and_the_units_next_to_them(tmp_path: Path) -> None:
    path, cells, channels = tmp_path / "a.vna", np.empty((2, 3), dtype=object), np.empty(3, dtype=object)
    for i, j in np.ndindex(2, 3):
        is_measured = (i, j) in ((0, 1), (0, 2))
        cells[i, j] = {"xfer": j * H if is_measured else [], "coh": np.full(F.size, 0.3 * j) if is_measured else []}
    named = (("hammer", 40.0, "N", 1), ("sensor", 100.0, "ms-2", 1), ("laser", 0.01, "ms-1", 0))
    channels[:] = [dict(zip(("label", "euscale_fac", "eu_string", "eu_on_off"), row, strict=True)) for row in named]
    measured = {"xcmeas": cells, "scmeas": channels, "fdxvec": F, "navg": 5}
    scipy.io.savemat(path, {"SampleRate": 2560, "SLm": measured}, appendmat=False)
    assert "1 sensor over hammer, 2 laser over hammer (give Description.response, for example 1)" in complaint(path)
    frf = read_frf(path, Description(response=1))
    assert frf.accelerance == pytest.approx(H * 100 / 40)
    assert frf.coherence == pytest.approx(0.3)
    assert frf.n_averages == 5
    laser = read_frf(path, Description(response=2, sensitivity=("100 mV/(mm/s)",)))
    assert laser.mobility == pytest.approx(2 * H / 40 / 100, rel=1e-9)


@pytest.mark.parametrize("name", ["freq_kHz", "freq_rad_s"])
def test_an_axis_is_in_the_unit_of_its_name(tmp_path: Path, name: str) -> None:
    path, axis = tmp_path / "a.mat", F / 1000 if "kHz" in name else 2 * np.pi * F
    scipy.io.savemat(path, {name: axis, "H": H})
    assert is_h(read_frf(path, Description(unit="m/N")))


def test_names_of_python_users_that_are_known(tmp_path: Path) -> None:
    force, said = np.zeros(200), Description(unit="m/s^2", force_unit="N")
    force[20:24] = 9, 20, 20, 9
    response = np.where(np.arange(200) < 20, 0.0, np.exp(-np.arange(200) / 20) * np.sin(np.arange(200)))
    path = npz(tmp_path / "a.npz", fs=2000, force=force, acceleration=response)
    (hit,) = read_hits(path, said)
    assert hit.sample_rate == pytest.approx(2000)
    two = npz(tmp_path / "two.npz", fs=2000, force=np.stack([force, force]), acc=np.stack([response, response]))
    assert "(force:1, force:2) (give Description.columns" in complaint(two)
    columns = ("force [N]=force:2", "acceleration [g]=acc:2")
    assert len(read_hits(two, Description(columns=columns, rate=2000))) == 1


def test_objects_of_matlab_are_skipped(tmp_path: Path) -> None:
    """Source: MAT-File Format (The MathWorks), level 5; class 17 is an object that only MATLAB can read."""

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"f": F, "H": H})
    texts = b"".join(element(1, text) for text in (b"T", b"MCOS", b"table"))
    number = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    inner = element(14, number + element(6, struct.pack("<I", 1)))
    path.write_bytes(path.read_bytes() + element(14, element(6, struct.pack("<II", 17, 0)) + texts + inner))
    assert is_h(read_frf(path, Description(unit="m/N")))


def test_what_is_in_cells_has_numbers(tmp_path: Path) -> None:
    path, cells = tmp_path / "a.mat", np.empty(2, dtype=object)
    cells[:] = [H, 2 * H]
    scipy.io.savemat(path, {"H": cells, "w": 2 * np.pi * F})
    assert "2 FRFs: 1 H:1, 2 H:2 (give Description.response" in complaint(path)
    assert is_h(read_frf(path, Description(columns=("frequency [rad/s]=w", "frf [m/N]=H:2"))), 2 * H)
    axis = {"start_value": 1.0, "increment": 1.0, "quantity": {"label": "Hz"}}
    cells[:] = [{"x_values": axis, "y_values": {"values": k * H, "quantity": {"label": "m/N"}}} for k in (1, 2)]
    scipy.io.savemat(path, {"FRF": cells})
    assert "2 FRFs: " in complaint(path)
    assert is_h(read_frf(path, Description(response=2)), 2 * H)


def test_what_is_no_array_of_numbers_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.array([{"f": F}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match=r"a\.npy: .*\(Object arrays .*\)"):
        inspect_file(path)
    np.save(path, H)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(DataError, match=r"a\.npy: "):
        inspect_file(path)
    bomb = tmp_path / "b.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("H.npy", "w") as member:
        for _ in range(11):
            member.write(bytes(10_000_000))
    with pytest.raises(DataError, match=r"b\.npz: .* MB .* 110 MB .* 100 MB"):
        inspect_file(bomb)


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=4), st.integers(1, 10**6), st.booleans()
)
def test_damaged_arrays_are_read_or_rejected(
    tmp_path: Path, changes: list[tuple[int, int]], end: int, packed: bool
) -> None:
    path = tmp_path / "a.npz"
    if packed:
        npz(path, freq=F, H=H)
    else:
        with path.open("wb") as file:
            np.save(file, H)
    content = bytearray(path.read_bytes())
    for place, byte in changes:
        content[place % len(content)] = byte
    path.write_bytes(content[: end % len(content) + 1] if not changes else content)
    with contextlib.suppress(DataError):
        inspect_file(path, Description(unit="m/N", spacing=None if packed else 1.0))


def test_a_file_of_ours_stays_ours(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5", x=F)
    with h5py.File(path, "r+") as file:
        file.attrs["format"] = "lobewatch-cut"
    with pytest.raises(DataError, match="lobewatch-tap"):
        inspect_file(path)
