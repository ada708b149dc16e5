"""`lobewatch shapes`: a simulated spindle of known shares, a universal file of others, checks, and mistakes."""

from __future__ import annotations

import shutil
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from acquisition import Structure
from dsm import receptance
from modal import Mode, synthesize_frf
from tests.lobewatch.commands.conftest import Run
from tests.modal.simulated_parts import SPINDLE, place_points, true_motion, true_shares

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import pyuff

POINTS = place_points(SPINDLE)
LINES = np.arange(60.0, 2400.0, 3.0)
HEAD = "point,position_mm,part,file"
UFF = Path(__file__).parents[2] / "data" / "pyuff_roving_hammer"
SVG = "{http://www.w3.org/2000/svg}"


def write_frf(path: Path, values: ArrayLike, unit: str = "m/N", lines: ArrayLike = LINES) -> None:
    """Write receptances."""
    table = np.column_stack([lines, np.real(values), np.imag(values)])
    np.savetxt(path, table, delimiter=",", header=f"frequency [Hz],real [{unit}],imag [{unit}]", comments="")


def write_table(folder: Path, rows: Sequence[str], head: str = HEAD) -> None:
    (folder / "points.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the FRFs of a simulated spindle with 2 % damping and a little noise."""
    folder, rng, rows = tmp_path_factory.mktemp("measured"), np.random.default_rng(5), []
    for i, (part, z, motion) in enumerate(POINTS):
        frf = motion * receptance(SPINDLE, LINES, z, 0.04, 0.0)
        noise = rng.normal(size=(2, LINES.size)) * 2e-4 * np.abs(frf).max()
        write_frf(folder / f"p{i}.csv", frf + noise[0] + 1j * noise[1])
        rows.append(f"p{i},{z * 1e3:g},{part},p{i}.csv")
    write_table(folder, rows)
    return folder


@pytest.fixture
def folder(measured: Path, tmp_path: Path) -> Path:
    """Return a copy of this folder."""
    return Path(shutil.copytree(measured, tmp_path / "points"))


def change_table(folder: Path, change: Callable[[list[str]], Sequence[str]], head: str = HEAD) -> None:
    write_table(folder, change((folder / "points.csv").read_text("utf-8").splitlines()[1:]), head)


def test_shares_of_a_simulated_spindle_are_found(run: Run, measured: Path) -> None:
    answer = run("shapes", measured, "--json").json
    modes, shares = true_shares(SPINDLE, 3)
    peaks = 1 / modes.stiffness_at(0.0)
    strong = [r for r in range(3) if peaks[r] > 0.1 * peaks.max()]
    assert len(strong) == 2
    for r in strong:
        (found,) = (one for one in answer["modes"] if abs(one["frequency_hz"] / modes.frequency[r] - 1) < 0.01)
        assert [row["parts"] for row in found["shares"]] == [["tool"], ["holder"], ["spindle"], ["column"]]
        assert [row["share"] for row in found["shares"]] == pytest.approx(shares[r], abs=0.1)
        assert sum(row["share"] for row in found["shares"]) == pytest.approx(1.0)
        assert found["shape"]["real"] == pytest.approx(true_motion(modes, POINTS, r), abs=0.02)
        at_tip = found["mass_normalized_shape"]["real"][0]
        assert at_tip == pytest.approx(abs(modes.deflection[r, 0]), rel=0.02)
        assert found["phase_collinearity"] > 0.99
    assert np.diag(answer["mac"]["values"]) == pytest.approx(np.ones(len(answer["mac"]["values"])))
    assert [point["part"] for point in answer["points"]] == [point[0] for point in POINTS]
    assert not {one["code"] for one in answer["remarks"]} & {"part-not-measured", "part-not-separated"}


def test_text_has_every_table(run: Run, folder: Path) -> None:
    answer = run("shapes", folder, "--against", folder)
    assert answer.code == 0
    for text in ("fn (Hz)", "motion over", "share of", "MAC of the modes", "MAC with points over 7 points"):
        assert text in answer.out


def test_figure_moves_in_each_mode_and_at_each_point(run: Run, folder: Path, tmp_path: Path) -> None:
    count = len(run("shapes", folder, "--json", "--figure", tmp_path / "a.svg").json["mac"]["values"])
    change_table(folder, lambda rows: [row.replace("p0,", "<&$,", 1) for row in rows])
    assert run("shapes", folder, "--figure", tmp_path / "b.html").code == 0
    root = ET.parse(tmp_path / "a.svg").getroot()
    assert len(root.findall(f"{SVG}circle/{SVG}animate")) == count * len(POINTS)
    assert len(root.findall(f"{SVG}polyline/{SVG}animate")) == 2 * count  # shaft and column
    first = root.find(f"{SVG}circle/{SVG}animate")
    assert first is not None
    heights = np.array(first.attrib["values"].split(";"), dtype=float)
    assert heights[0] == heights[-1] < heights[len(heights) // 2]
    html = (tmp_path / "b.html").read_text("utf-8")
    assert "&lt;&amp;$" in html
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")


def test_exchanged_and_repeated_measurements_are_checked_and_averaged(run: Run, folder: Path) -> None:
    values = np.loadtxt(folder / "p3.csv", delimiter=",", skiprows=1)
    frf = values[:, 1] + 1j * values[:, 2]
    write_frf(folder / "again.csv", 1.04 * frf)
    write_frf(folder / "exchanged.csv", -1.3 * frf)
    rows = ["p3,162,spindle,again.csv,", "p3,162,spindle,exchanged.csv,hit"]
    change_table(folder, lambda old: [*(f"{row}," for row in old), *rows], f"{HEAD},role")
    answer = run("shapes", folder, "--json").json
    checks = {check["kind"]: check for check in answer["checks"]}
    assert (checks["repeatability"]["is_passed"], checks["reciprocity"]["is_passed"]) == (True, False)
    assert checks["repeatability"]["scale"] == pytest.approx(1.04)
    assert checks["reciprocity"]["scale"] == pytest.approx(-1.3)
    assert [one["about"] for one in answer["remarks"] if one["code"] == "not-reciprocal"] == ["point p3"]
    assert "not-repeatable" not in {one["code"] for one in answer["remarks"]}
    assert answer["points"][3]["count"] == 3


def test_a_sensor_in_the_opposite_direction_changes_the_sign(run: Run, folder: Path) -> None:
    before = run("shapes", folder, "--json").json["modes"][0]["shape"]["real"]
    change_table(
        folder, lambda rows: [f"{row},{'-x' if row[:2] == 'p5' else 'x'}" for row in rows], f"{HEAD},direction"
    )
    after = run("shapes", folder, "--json").json["modes"][0]["shape"]["real"]
    assert after == pytest.approx([-value if i == 5 else value for i, value in enumerate(before)], abs=1e-4)


def test_points_without_a_direction_have_that_of_the_tip(run: Run, folder: Path) -> None:
    before = run("shapes", folder, "--json").json["modes"][0]["shape"]["real"]
    turned = {"p0": "-x", "p5": "x"}
    change_table(folder, lambda rows: [f"{row},{turned.get(row[:2], '')}" for row in rows], f"{HEAD},direction")
    after = run("shapes", folder, "--json").json["modes"][0]["shape"]["real"]
    assert after == pytest.approx([-value if i == 5 else value for i, value in enumerate(before)], abs=1e-4)


def test_an_earlier_set_is_compared_by_the_names_of_its_points(run: Run, folder: Path, tmp_path: Path) -> None:
    earlier = Path(shutil.copytree(folder, tmp_path / "earlier"))
    change_table(earlier, lambda rows: rows[::-1][:4] + rows[:1])
    against = run("shapes", folder, "--against", earlier, "--json").json["against"]
    assert against["points"] == ["p0", "p3", "p4", "p5", "p6"]
    assert max(against["mac"][0]) == pytest.approx(1.0, abs=1e-3)
    change_table(earlier, lambda rows: [row.replace("p", "q", 1) for row in rows])
    assert run("shapes", folder, "--against", earlier).code == 2


def test_universal_file_of_another_program_is_read_by_its_nodes(run: Run, tmp_path: Path) -> None:
    """The jumps of the FRFs over a peak, from one line to the next, are in the ratio of the shape."""
    shutil.copy(UFF / "measurement.uff", tmp_path)
    rows = [
        f"{name},{z},{part},measurement.uff,{node}"
        for node, (name, z, part) in enumerate(
            [("one", 0, "tool"), ("two", 100, "holder"), ("three", 200, "spindle")], 1
        )
    ]
    write_table(tmp_path, rows, f"{HEAD},node")
    answer = run("shapes", tmp_path, "--json", "--unit", "m/s^2/N").json
    shapes = {round(mode["frequency_hz"]): mode["shape"]["real"] for mode in answer["modes"]}
    frfs = pyuff.UFF(str(UFF / "measurement.uff")).read_sets()
    for peak in (142, 460):
        line = int(np.argmin(np.abs(frfs[0]["x"] - peak)))
        jump = np.array([frf["data"][line + 1] - frf["data"][line] for frf in frfs])
        assert shapes[peak] == pytest.approx((jump / jump[0]).real, abs=0.03)
    assert answer["mac"]["values"][1][3] == pytest.approx(0.42, abs=0.05)
    assert answer["modes"][0]["shares"] == [
        {"parts": ["tool", "holder", "spindle"], "share": pytest.approx(1.0), "share_std": pytest.approx(0.0, abs=1e-9)}
    ]


def write_uff(path: Path, frfs: Sequence[tuple[int, int, int, int, float]]) -> None:
    """Write FRFs of response node and direction, hit node and direction, and motion of one mode, by pyuff."""
    for response, response_direction, hit, hit_direction, motion in frfs:
        sign = np.sign(response_direction * hit_direction)
        values = sign * synthesize_frf([Mode(700.0, 0.02, 2e7 / motion)], LINES).accelerance
        fields = {"type": 58, "func_type": 4, "data": values, "x": LINES, "abscissa_spacing": 1, "binary": 0}
        fields |= {"rsp_node": response, "rsp_dir": response_direction, "ref_node": hit, "ref_dir": hit_direction}
        fields |= {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13}
        fields |= {"ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "N"}
        pyuff.UFF(str(path)).write_sets(fields, "add")


def test_nodes_say_what_was_hit_and_in_which_direction(run: Run, tmp_path: Path) -> None:
    in_x = [(1, 1, 1, 1, 1.0), (2, 1, 1, 1, 0.5), (1, 1, 2, 1, 0.51), (3, -1, 1, 1, -0.3)]
    write_uff(tmp_path / "all.uff", [*in_x, (2, 2, 1, 2, 0.9), (2, 2, 1, 1, 0.2)])
    rows = [f"n{node},{40 * node},tool,all.uff,{node}" for node in (1, 2, 3)]
    write_table(tmp_path, rows, f"{HEAD},node")
    assert run("shapes", tmp_path).code == 2  # node 2 has x and y
    for own in ("x", "-x"):  # the file has the signs, whatever the table says of one point
        directions = ("x", own, own)
        table = [f"{row},{direction}" for row, direction in zip(rows, directions, strict=True)]
        write_table(tmp_path, table, f"{HEAD},node,direction")
        answer = run("shapes", tmp_path, "--json").json
        assert answer["modes"][0]["shape"]["real"] == pytest.approx([1.0, 0.505, -0.3], abs=1e-3)
    (check,) = answer["checks"]
    assert (check["point"], check["kind"], check["scale"]) == ("n2", "reciprocity", pytest.approx(1.02, abs=1e-3))


def test_hits_that_ring_at_the_end_have_one_window_at_all_points(run: Run, tmp_path: Path) -> None:
    time, rows = np.arange(-200, 2000) / 10240.0, []
    pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    rng = np.random.default_rng(0)
    for i, motion in enumerate((1.0, 0.6, -0.4)):
        structure = Structure(np.array([500.0]), np.array([0.004]), np.array([2e7 / motion]))
        hits = [(size * pulse, size * structure.response(time, 1e-3)) for size in (150.0, 210.0, 180.0)]
        columns = [part + rng.normal(0, 0.2, time.size) for hit in hits for part in hit]
        names = ",".join(f"force_{k} [N],response_{k} [m/s^2]" for k in range(1, 4))
        table = np.column_stack([time, *columns])
        np.savetxt(tmp_path / f"h{i}.csv", table, delimiter=",", header=f"time [s],{names}", comments="")
        rows.append(f"h{i},{100 * i},tool,h{i}.csv")
    write_table(tmp_path, rows)
    answer = run("shapes", tmp_path, "--one-test", "--json").json
    assert "windowed-here" in {one["code"] for one in answer["remarks"]}
    (mode,) = answer["modes"]
    assert mode["damping_ratio"] == pytest.approx(0.004, rel=0.02)
    assert mode["stiffness_n_per_m"] == pytest.approx(2e7, rel=0.02)
    assert mode["shape"]["real"] == pytest.approx([1.0, 0.6, -0.4], abs=0.01)
    assert mode["hits"] == 3


def cut_lines(folder: Path) -> None:
    values = np.loadtxt(folder / "p2.csv", delimiter=",", skiprows=1)[::2]
    write_frf(folder / "p2.csv", values[:, 1] + 1j * values[:, 2], lines=values[:, 0])


def change_quantity(folder: Path) -> None:
    values = np.loadtxt(folder / "p2.csv", delimiter=",", skiprows=1)
    write_frf(folder / "p2.csv", values[:, 1] + 1j * values[:, 2], "m/s^2/N")


MISTAKES: dict[str, tuple[Callable[[Path], object], Sequence[str]]] = {
    "no table": (lambda folder: (folder / "points.csv").unlink(), ["points.csv"]),
    "no file": (lambda folder: (folder / "p2.csv").unlink(), ["p2", "p2.csv", "line 4"]),
    "other lines": (cut_lines, ["p2", "p2.csv", "390"]),
    "other quantity": (change_quantity, ["p2", "p2.csv", "accelerance"]),
    "same data": (lambda folder: shutil.copy(folder / "p1.csv", folder / "p2.csv"), ["p2", "p1.csv"]),
    "damaged file": (lambda folder: (folder / "p2.csv").write_text("frequency [Hz],real [m/N],imag\n1,2,x\n"), ["p2"]),
    "two points": (lambda folder: change_table(folder, lambda rows: rows[:2]), ["2 points", "3"]),
    "duplicate name": (
        lambda folder: change_table(folder, lambda rows: [row.replace("p3,", "p2,", 1) for row in rows]),
        ["p2", "130 mm", "162 mm"],
    ),
    "unknown part": (
        lambda folder: change_table(folder, lambda rows: [row.replace("holder", "arbor") for row in rows]),
        ["p1", "arbor", "holder"],
    ),
    "parts out of order": (
        lambda folder: change_table(folder, lambda rows: [row.replace("p0,0", "p0,140") for row in rows]),
        ["p0", "tool"],
    ),
    "no number": (
        lambda folder: change_table(folder, lambda rows: [row.replace("162", "about 160") for row in rows]),
        ["p3", "about 160"],
    ),
    "unknown column": (lambda folder: change_table(folder, lambda rows: rows, f"{HEAD},colour"), ["colour", "role"]),
    "missing column": (lambda folder: change_table(folder, lambda rows: rows, HEAD.replace("part", "role")), ["part"]),
    "two directions": (
        lambda folder: change_table(
            folder, lambda rows: [f"{row},{'xy'[row[:2] == 'p4']}" for row in rows], f"{HEAD},direction"
        ),
        ["p4", "direction y"],
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_sentence_with_file_and_point(run: Run, folder: Path, name: str) -> None:
    spoil, facts = MISTAKES[name]
    spoil(folder)
    answer = run("shapes", folder)
    assert (answer.code, answer.out) == (2, "")
    assert "Traceback" not in answer.err
    assert [fact for fact in facts if fact not in answer.err] == []


@pytest.mark.parametrize(("node", "fact"), [("7", "7"), ("x", "node"), ("0", "node")])
def test_a_wrong_node_is_named(run: Run, tmp_path: Path, node: str, fact: str) -> None:
    shutil.copy(UFF / "measurement.uff", tmp_path)
    rows = [f"a,0,tool,measurement.uff,{1}", f"b,50,tool,measurement.uff,{node}", "c,90,tool,measurement.uff,3"]
    write_table(tmp_path, rows, f"{HEAD},node")
    answer = run("shapes", tmp_path, "--unit", "m/s^2/N")
    assert answer.code == 2
    assert "point b" in answer.err
    assert fact in answer.err


def test_an_unknown_figure_is_refused(run: Run, folder: Path) -> None:
    answer = run("shapes", folder, "--figure", folder / "a.gif")
    assert answer.code == 2
    assert ".gif" in answer.err
