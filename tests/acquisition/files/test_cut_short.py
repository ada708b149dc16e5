"""Files of every format, cut at any byte: rejected, questioned, or read with the same numbers."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import nptdms
import numpy as np
import pytest
import scipy.io.wavfile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition import Circumstances, DataError, Description, Frf, Hit, TapTest, inspect_file, new_tap_id, write_tap
from acquisition.files.convert import EXPORT_FORMATS, ExportLabels

RANDOM = np.random.default_rng(1)
HIT = Hit(RANDOM.normal(size=40), RANDOM.normal(size=40), 1000.0)
F = np.arange(2.0, 42.0)
FRF = Frf(F, np.asarray(1e-6 / (1 + 0.1j * F), np.complex128), np.full(F.size, 0.9), 5)
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\nChannels\t2\t\nSamples\t40\t40\n"
    "Y_Unit_Label\tN\tg\nDelta_X\t0.001\t0.001\n***End_of_Header***\t\t\nX_Value\tForce\tAcceleration\tComment\n"
)


def lvm(path: Path) -> None:
    rows = zip(np.arange(40) / 1000, HIT.force, HIT.acceleration, strict=True)
    path.write_text(LVM + "".join("\t".join(f"{value:.6f}" for value in row) + "\n" for row in rows))


def tdms(path: Path) -> None:
    pairs = (("Hammer", "N", HIT.force), ("Tip", "g", HIT.acceleration))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("tap", name, values, {"unit_string": unit, "wf_increment": 1e-3})
                for name, unit, values in pairs
            ]
        )


def wav(path: Path) -> None:
    scipy.io.wavfile.write(path, 1000, np.column_stack([HIT.force, HIT.acceleration]).astype(np.float32))


def tap_file(path: Path) -> None:
    about = Circumstances("m", datetime(2024, 5, 1, tzinfo=UTC), "reference")
    write_tap(path, TapTest(new_tap_id(about), about, FRF))


def of_hits(extension: str) -> Callable[[Path], None]:
    def made(path: Path) -> None:
        path.write_bytes(EXPORT_FORMATS[extension].encode_hits([HIT], ExportLabels()))

    return made


def of_frf(extension: str) -> Callable[[Path], None]:
    write = EXPORT_FORMATS[extension].encode_frf
    assert write is not None

    def made(path: Path) -> None:
        path.write_bytes(write(FRF, ExportLabels()))

    return made


def uncounted(path: Path) -> None:
    """Write a table as the first versions did: without its number of rows."""
    of_frf(".csv")(path)
    path.write_text(path.read_text().replace("# rows: 40\n", ""))


MADE: dict[str, Callable[[Path], None]] = {
    "hit.lvm": lvm,
    "hit.tdms": tdms,
    "hit.wav": wav,
    "hit.uff": of_hits(".uff"),
    "frf.uff": of_frf(".uff"),
    "hit.csv": of_hits(".csv"),
    "frf.csv": of_frf(".csv"),
    "uncounted.csv": uncounted,
    "hit.json": of_hits(".json"),
    "tap.h5": tap_file,
}
SAID = {"hit.wav": Description(columns=("force [N]", "acceleration [g]"), full_scale=(1, 1))}


@pytest.mark.parametrize("name", MADE)
def test_a_file_cut_at_any_byte_gives_no_other_numbers(tmp_path: Path, name: str) -> None:
    MADE[name](tmp_path / name)
    content, cut, said = (tmp_path / name).read_bytes(), tmp_path / f"cut {name}", SAID.get(name, Description())
    whole = inspect_file(tmp_path / name, said).require_valid()

    @settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(st.integers(0, len(content) - 1) | st.integers(len(content) - 12, len(content) - 1))
    def check(end: int) -> None:
        cut.write_bytes(content[:end])
        try:
            found = inspect_file(cut, said)
        except DataError:
            return
        if not found.problems:
            assert_begins(found.frf, whole.frf, may_be_shorter=name == "uncounted.csv")
            for one, other in zip(found.hits, whole.hits, strict=True):
                assert one.force.tolist() == other.force.tolist()
                assert one.acceleration.tolist() == other.acceleration.tolist()

    check()


def assert_begins(found: Frf | None, whole: Frf | None, *, may_be_shorter: bool) -> None:
    assert (found is None) == (whole is None)
    if found is not None and whole is not None:
        n = found.frequency.size
        assert n == whole.frequency.size or may_be_shorter
        last = n - 1 if may_be_shorter else n  # a digit less of the last number cannot be seen
        assert found.receptance[:last].tolist() == whole.receptance[:last].tolist()


@pytest.mark.parametrize("name", ["frf.csv", "hit.csv"])
def test_our_table_cut_at_each_byte_is_rejected(tmp_path: Path, name: str) -> None:
    MADE[name](tmp_path / name)
    content, cut = (tmp_path / name).read_bytes(), tmp_path / "cut.csv"
    for end in range(len(content)):
        cut.write_bytes(content[:end])
        with pytest.raises(DataError, match=r"cut\.csv"):
            inspect_file(cut)


def test_a_table_of_ours_with_other_rows_than_it_says_is_rejected_with_the_place(tmp_path: Path) -> None:
    of_frf(".csv")(tmp_path / "a.csv")
    whole = (tmp_path / "a.csv").read_text().splitlines(keepends=True)
    for lines, place in (
        (whole[:-1], r"a\.csv: 39 of 40 rows"),
        ([*whole, whole[-1].replace("41.0", "42.0", 1)], r"a\.csv: 41 of 40 rows"),
        ([*whole[:-1], whole[-1].rstrip()], r"a\.csv: truncated at line 44"),
    ):
        (tmp_path / "a.csv").write_text("".join(lines))
        with pytest.raises(DataError, match=place):
            inspect_file(tmp_path / "a.csv")


def test_rows_that_another_program_counts_are_not_ours_to_evaluate(tmp_path: Path) -> None:
    of_frf(".csv")(tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text().replace("written by: lobewatch", "written by: another")
    (tmp_path / "a.csv").write_text(text.replace("# rows: 40", "# rows: 41").rstrip())
    frf = inspect_file(tmp_path / "a.csv").require_valid().frf
    assert frf is not None
    assert np.array_equal(frf.receptance, FRF.receptance)


def test_a_table_of_ours_with_the_line_ends_of_windows_is_read(tmp_path: Path) -> None:
    of_frf(".csv")(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_bytes((tmp_path / "a.csv").read_bytes().replace(b"\n", b"\r\n"))
    frf = inspect_file(tmp_path / "a.csv").require_valid().frf
    assert frf is not None
    assert np.array_equal(frf.receptance, FRF.receptance)
