"""MATLAB files of all versions with bits flipped, lengths garbled, parts zeroed and ends cut off: read or rejected."""

from __future__ import annotations

import io
import random
import resource
import signal
import struct
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from acquisition import DataError, Description, Frf, Hit, inspect_file, read_frf
from acquisition.files.convert import EXPORT_FORMATS, ExportLabels
from acquisition.files.readers import mat_variables

DATA = Path(__file__).parents[3] / "data"
F = np.arange(2.0, 100.0, 2.0)
H = np.asarray(1e-6 / (1 + 0.2j * F), np.complex128)
LENGTHS = (0, 1, 5, 7, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)


def saved(variables: dict[str, Any], **options: Any) -> bytes:
    content = io.BytesIO()
    scipy.io.savemat(content, variables, **options)
    return content.getvalue()


def hdf5(variables: dict[str, Any]) -> bytes:
    """Return a MATLAB -v7.3 file: a header of 512 bytes, then HDF5, text as codes, cells as references."""
    content = io.BytesIO()
    with h5py.File(content, "w", userblock_size=512) as file:
        for name, value in variables.items():
            if isinstance(value, str):
                codes = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
                file.create_dataset(name, data=codes).attrs["MATLAB_class"] = np.bytes_("char")
            elif isinstance(value, dict):
                for key, part in value.items():
                    file.create_dataset(f"{name}/{key}", data=np.atleast_2d(part).T, compression="gzip")
            elif isinstance(value, list):
                parts = [file.create_dataset(f"#refs#/{i}", data=np.atleast_2d(part)) for i, part in enumerate(value)]
                file.create_dataset(name, data=np.array([[part.ref for part in parts]], h5py.ref_dtype))
            else:
                pairs = np.stack([np.real(value), np.imag(value)], axis=-1).astype(float)
                data = pairs.view([("real", "f8"), ("imag", "f8")])[..., 0] if np.iscomplexobj(value) else value
                file.create_dataset(name, data=np.atleast_2d(data).T).attrs["MATLAB_class"] = np.bytes_("double")
    return b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + content.getvalue()[512:]


def sound_files() -> dict[str, bytes]:
    """Return sound files: available third-party files, our own, and one of each version and layout."""
    files = {path.name: path.read_bytes() for path in sorted(DATA.glob("*/*.mat"))}
    generator = np.random.default_rng(1)
    hits = [Hit(generator.normal(size=60), generator.normal(size=60), 1000.0) for _ in range(3)]
    writer = EXPORT_FORMATS[".mat"]
    assert writer.encode_frf is not None
    files |= {
        "our FRF": writer.encode_frf(Frf(F, H, np.full(F.size, 0.9), 5), ExportLabels()),
        "our hits": writer.encode_hits(hits, ExportLabels()),
    }
    values = {"values": H[:, None], "quantity": {"label": "(m/s^2)/N"}}
    test_lab = {"FRF": {"x_values": {"start_value": 0.0, "increment": 2.0}, "y_values": values}}
    names = np.array(["hammer", "tip", "nut"], dtype=object)
    cells = {f"H1_{i}": np.stack([F + 0j, i * H], axis=1) for i in (2, 3)} | {"ChanName": names, "Unit": names}
    vectors = {"freq": F, "frf": H, "note": "abc"}
    files |= {"structs": saved(test_lab), "structs, v7": saved(test_lab, do_compression=True)}
    files |= {"cells": saved(cells), "cells, v7": saved(cells, do_compression=True)}
    files |= {"v4": saved(vectors, format="4")}
    return files | {"v7.3": hdf5(vectors | {"more": {"x": F, "y": F}, "cells": [F, F]})}


SOUND = sound_files()


def damaged(content: bytes, chance: random.Random) -> bytes:
    """Return a sound file with one kind of damage."""
    spoilt, size = bytearray(content), len(content)
    kind = chance.choice(("bit", "bits", "cut", "zeros", "length", "length", "length", "moved"))
    if kind in ("bit", "bits"):
        for _ in range(1 if kind == "bit" else chance.randrange(2, 40)):
            spoilt[chance.randrange(size)] ^= 1 << chance.randrange(8)
    elif kind == "cut":
        del spoilt[chance.randrange(1, size) :]
    elif kind == "length":
        for _ in range(chance.randrange(1, 4)):
            at = chance.randrange((size if chance.random() < 0.4 else min(size, 700)) // 4 - 1) * 4
            spoilt[at : at + 4] = struct.pack(
                "<I", chance.choice((*LENGTHS, chance.getrandbits(32), chance.getrandbits(8)))
            )
    else:
        at, source, n = chance.randrange(size), chance.randrange(size), chance.choice((4, 8, 64, 1024))
        spoilt[at : at + n] = bytes(n) if kind == "zeros" else content[source : source + n]
    return bytes(spoilt[:size])


class Forks:
    """The program that reads MATLAB files, started by a fork of one that has imported it: 50 times as fast."""

    SERVER = """
import os, sys
import scipy.io
from acquisition.files.readers import mat_variables
for line in sys.stdin:
    sys.argv = ["", line.rstrip("\\n")]
    child = os.fork()
    if not child:
        os.dup2(os.open(sys.argv[1] + ".read", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
        mat_variables.main()
        sys.stdout.flush()
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""

    def __init__(self) -> None:
        command, pipe = [sys.executable, "-Wignore", "-c", self.SERVER], subprocess.PIPE
        self._server = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)
        self.ended_by: Counter[str] = Counter()
        """Number of reader processes ended by each signal."""

    def run_apart(self, _module: str, path: str, **_: float) -> bytes:
        """Run a reader as `run_in_subprocess` does."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(f"{path}\n")
        self._server.stdin.flush()
        if code := int(self._server.stdout.readline()):
            self.ended_by[signal.Signals(-code).name] += 1
            raise subprocess.CalledProcessError(code, path)
        return Path(f"{path}.read").read_bytes()

    def close(self) -> None:
        self._server.communicate(timeout=60)


@pytest.fixture
def forks(monkeypatch: pytest.MonkeyPatch) -> Iterator[Forks]:
    made = Forks()
    monkeypatch.setattr(mat_variables, "run_in_subprocess", made.run_apart)
    yield made
    made.close()


def outcome(path: Path) -> str:
    """Return how a file was read."""
    try:
        if inspect_file(path).problems:
            return "incomplete"
        read_frf(path)
    except DataError as error:
        return "rejected" if str(path) in str(error) else str(error)
    return "read"


def assert_read_or_refused(folder: Path, count: int, forks: Forks) -> None:
    """Damaged files, each once; whatever else than DataError one of them leads to is raised."""
    path, contents = folder / "a.mat", list(SOUND.values())
    outcomes: Counter[str] = Counter()
    for seed in range(count):
        path.write_bytes(damaged(contents[seed % len(contents)], random.Random(seed)))
        outcomes[outcome(path)] += 1
    assert set(outcomes) <= {"rejected", "incomplete", "read"}
    assert outcomes["rejected"] > 0.3 * count
    assert set(forks.ended_by) <= {"SIGSEGV", "SIGBUS", "SIGABRT", "SIGXCPU"}


def test_sixty_damaged_files_are_read_or_rejected(tmp_path: Path, forks: Forks) -> None:
    assert_read_or_refused(tmp_path, 60, forks)


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_five_thousand_damaged_files_are_read_or_rejected(tmp_path: Path, forks: Forks) -> None:
    assert_read_or_refused(tmp_path, 5000, forks)


def test_a_file_that_would_be_read_for_hours_is_rejected_after_seconds(tmp_path: Path) -> None:
    """The length of a struct without fields, which need no bytes, makes scipy create three million."""
    content = bytearray(saved({"c": {"x": np.array([[{}]], dtype=object)}}))
    at = content.rindex(struct.pack("<4i", 5, 8, 1, 1)) + 8  # behind the tag of the dimensions of the innermost
    content[at : at + 4] = struct.pack("<i", 3_000_000)
    (tmp_path / "a.mat").write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with pytest.raises(DataError, match=r"a\.mat: .*hangs"):
        inspect_file(tmp_path / "a.mat")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 30


@pytest.mark.parametrize(
    "content",
    [
        saved({"freq": F, "frf": H}, format="4"),
        saved({"freq": F, "frf": H}),
        saved({"freq": F, "frf": H}, do_compression=True),
        hdf5({"freq": F, "frf": H}),
    ],
    ids=["v4", "v5", "v7", "v7.3"],
)
def test_the_program_itself_reads_no_mat_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes) -> None:
    def crash(*_: object, **__: object) -> None:
        pytest.fail("a damaged file could end this program here")

    (tmp_path / "a.mat").write_bytes(content)
    for reader in ("scipy.io.loadmat", "scipy.io.whosmat", "h5py.File"):
        monkeypatch.setattr(reader, crash)
    frf = read_frf(tmp_path / "a.mat", Description(unit="m/N"))
    assert np.array_equal(frf.frequency, F)
    assert np.array_equal(frf.receptance, H)
