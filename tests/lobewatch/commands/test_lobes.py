"""`lobewatch check` and `lobewatch lobes`: verdicts, advice, methods, pictures, materials."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from acquisition import Circumstances, TapDirection, TapTest, from_accelerance, new_tap_id
from lobes import (
    Cut,
    DepthBand,
    Pocket,
    Program,
    check_program,
    radial_lobes,
    stability_boundary,
    tolerable_decay,
)
from lobewatch.analysis import Logbook, aging, lobes_of
from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.machine_file import parse_machine
from lobewatch.machine.new_folder import make_machine_folder
from lobewatch.show.figures_lobes import lobes_figure, radial_figure, waterfall_figure
from modal import Mode, synthesize

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
LINES = np.arange(4.0, 4000.0, 4.0)


class Said(NamedTuple):
    code: int
    out: str
    err: str


Run = Callable[..., Said]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    monkeypatch.chdir(tmp_path)

    def command(*arguments: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["lobewatch", *arguments])
        capsys.readouterr()
        code: Any = 0
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
        return Said(code, *capsys.readouterr())

    return command


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    return edit(MachineFolder(tmp_path / "m"), "high_rpm = 24000", "high_rpm = 24000\nsteps = 300")


def tap(
    folder: MachineFolder, frequency: float, days: float = 0.0, direction: TapDirection = "x", stiffness: float = 3.5e7
) -> None:
    when = START + timedelta(days=days)
    about = Circumstances("m", when, "reference", direction, "", folder.toml.read_text("utf-8"))
    frf = synthesize([Mode(frequency, 0.029136, stiffness)], LINES)
    folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))


def edit(folder: MachineFolder, old: str, new: str) -> MachineFolder:
    text = folder.toml.read_text("utf-8")
    assert old in text
    folder.toml.write_text(text.replace(old, new), "utf-8")
    return MachineFolder(folder.path)


def test_a_new_spindle_passes_and_an_aged_one_does_not(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    good = run("check", "m")
    assert (good.code, good.out.splitlines()[-1]) == (0, "0 of 3 programs not stable")
    tap(folder, 1713.0 * 0.9, days=700)
    said = run("check", "m")
    assert said.code == 1
    assert said.out.splitlines()[-1] == "2 of 3 programs not stable"
    assert said.out.count("NOT STABLE any more") == 2
    assert "A: slot at 12 600 rpm: chatter near 15" in said.out
    assert "the nearest stable speed" in said.out
    assert "modes in the x direction alone" in said.out


def test_the_numbers_of_check_are_those_of_lobes(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1690.0, days=0.2, direction="y")
    said = json.loads(run("check", "m", "--json").out)
    newest = Logbook(folder).assembly()
    assert newest.x is not None
    assert newest.y is not None
    assert newest.x[0].frequency == pytest.approx(1713, abs=0.1)
    for entry, table in zip(said["programs"], folder.machine.program, strict=True):
        program = Program(folder.machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)
        found = check_program(program, newest.x, newest.y, np.array([table.speed_rpm]))
        assert entry["limit_mm"] == pytest.approx(found.limit * 1e3, rel=1e-6)
        assert entry["stable"] == found.stable
        assert entry["depth_margin"] == pytest.approx(entry["limit_mm"] / entry["depth_mm"] - 1)
        assert entry["limit_low_mm"] <= entry["limit_mm"] <= entry["limit_high_mm"]


def test_decay_left_follows_the_model_or_keeps_k(folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    newest = Logbook(folder).assembly()
    modes_at, said = aging(newest)
    assert "K changes as in the model" in said.text
    x, y = modes_at(0.9)
    assert x is not None
    assert y is None
    assert newest.x is not None
    assert x[0].frequency == pytest.approx(0.9 * newest.x[0].frequency)
    assert x[0].stiffness / newest.x[0].stiffness == pytest.approx(0.986, abs=0.002)
    logbook = Logbook(folder)
    first = logbook.verdicts()[0]
    program = Program(folder.machine.build_cut(first.program), 12600.0, 6e-3)
    assert logbook.advice(first).decay == pytest.approx(tolerable_decay(program, modes_at))
    assert 0.01 < logbook.advice(first).decay < 0.1
    bare = folder.toml.read_text("utf-8").partition("# The spindle of the example")[0]
    folder.toml.write_text(bare, "utf-8")
    without = Logbook.open(folder.path).assembly()
    modes_at, said = aging(without)
    assert "K does not (no model)" in said.text
    aged = modes_at(0.9)[0]
    assert aged is not None
    assert without.x is not None
    assert aged[0].stiffness == without.x[0].stiffness


def test_the_drive_and_missing_taps_are_told(run: Run, folder: MachineFolder) -> None:
    edit(folder, "speed_rpm = 12600", "feed_per_tooth_mm = 0.1\nspeed_rpm = 12600")
    edit(folder, "[speed]", "[drive]\npower_kw = 5\n\n[speed]")
    edit(folder, 'name = "B: slot at 6 200 rpm"\ntool = "reference"', 'name = "B: slot at 6 200 rpm"\ntool = "T7"')
    tap(folder, 1713.0)
    said = run("check", "m")
    assert "A: slot at 12 600 rpm: [drive] allows no more than" in said.out
    assert "not checked: no tap test with tool 'T7'" in said.out
    assert said.code == 1
    assert said.out.splitlines()[-1] == "0 of 2 programs not stable, 1 of 3 not checked"
    assert "note: C: slot at 16 000 rpm: [drive] does not count: feed_per_tooth_mm is missing" in said.out
    power = 4 * 0.02 / (4 * np.pi) * 2 * 1400e6 * 1e-4 * 2 * np.pi * 12600 / 60
    assert f"{np.floor(5000 / power * 1e5) / 100:.2f} mm" in said.out


def test_programs_that_cannot_be_checked_are_no_success(run: Run, folder: MachineFolder) -> None:
    edit(folder, 'tool = "reference"\nteeth', 'tool = "T7"\nteeth')
    tap(folder, 1713.0)
    said = run("check", "m", "--json")
    assert (said.code, json.loads(said.out)["not_checked"], json.loads(said.out)["unstable"]) == (1, 3, 0)


def test_any_more_is_said_of_the_same_directions_only(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1713.0 * 0.9, days=700)
    assert run("check", "m").out.count("NOT STABLE any more") == 2
    tap(folder, 1713.0 * 0.9, days=700.1, direction="y")
    tap(folder, 1713.0 * 0.9, days=700.2)
    said = run("check", "m").out
    assert ("NOT STABLE" in said, "any more" in said) == (True, False)


def test_beyond_the_drive_and_notes_of_single_programs(run: Run, folder: MachineFolder) -> None:
    edit(folder, "speed_rpm = 12600", "feed_per_tooth_mm = 0.1\nspeed_rpm = 12600")
    edit(folder, "[speed]", "[drive]\npower_kw = 0.5\n\n[speed]")
    edit(folder, "depth_mm = 8.0", "depth_mm = 80.0")
    tap(folder, 1713.0)
    said = run("check", "m")
    (row,) = (line for line in said.out.splitlines() if line.startswith("A: slot at 12 600 rpm  "))
    assert row.endswith("beyond the drive")
    assert "note: reference: decay left" in said.out
    assert "note: reference: modes in the x direction alone" in said.out


def test_a_long_check_says_how_far_it_is(run: Run, folder: MachineFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lobewatch.commands.check.PATIENCE", -1.0)
    tap(folder, 1713.0)
    assert run("check", "m").err.count("0 of 3 programs are checked") == 1


def test_no_stable_speed_is_said(run: Run, folder: MachineFolder) -> None:
    edit(folder, "depth_mm = 6.0", "depth_mm = 900.0")
    tap(folder, 1713.0)
    assert "no stable speed at this depth in 3000..24000 rpm" in run("check", "m").out


def test_check_without_anything_to_check_is_refused(run: Run, folder: MachineFolder) -> None:
    said = run("check", "m")
    assert (said.code, "no tap test yet" in said.err) == (2, True)
    make_machine_folder(Path("plain"), "new_machine.toml")
    said = run("check", "plain")
    assert (said.code, "no [[program]] to check" in said.err) == (2, True)


def test_methods_pockets_and_shifts(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1713.0 * 0.95, days=300)
    zero, angle, semi = (
        json.loads(run("lobes", "m", "--json", "--method", method).out)
        for method in ("zero-order", "average-angle", "semi-discretisation")
    )
    assert zero["minimum_depth_mm"] == pytest.approx(2 * angle["minimum_depth_mm"], rel=1e-6)
    assert zero["minimum_depth_mm"] == pytest.approx(semi["minimum_depth_mm"], rel=0.01)
    assert semi["method"] == "semi-discretisation"
    assert semi["method_detail"].endswith(" pieces of order 16 a tooth period")
    shifts = zero["pocket_shifts"]
    assert len(shifts) >= 3
    step = 21000 / 299
    for shift in shifts:
        moved = shift["now"]["speed_rpm"] - 0.95 * shift["then"]["speed_rpm"]
        assert abs(moved) <= 1.1 * step
        assert shift["speed_change"] == pytest.approx(shift["now"]["speed_rpm"] / shift["then"]["speed_rpm"] - 1)
    best = zero["pockets_by_depth"][0]
    index = int(np.argmin(np.abs(np.array(zero["speed_rpm"]) - best["speed_rpm"])))
    assert best["depth_mm"] <= zero["depth_mm"][index]
    assert zero["pockets_by_removal"][0]["speed_rpm"] == max(p["speed_rpm"] for p in zero["pockets_by_depth"])
    said = run("lobes", "m", "--source", "frf", "--method", "semi-discretisation")
    assert (said.code, "leave --source frf out" in said.err) == (2, True)


def test_pictures(run: Run, folder: MachineFolder) -> None:
    edit(folder, "steps = 300", "steps = 60")
    edit(folder, "tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500", 'material = "Al 7075 (HSS; dry)"')
    folder = MachineFolder(folder.path)
    tap(folder, 1713.0)
    said = run("lobes", "m", "--figure", "l.png", "--radial", "r.svg", "--waterfall", "w.png")
    assert said.code == 0, said.err
    assert Path("l.png").read_bytes().startswith(b"\x89PNG")
    assert Path("w.png").read_bytes().startswith(b"\x89PNG")
    assert "radial depth (mm)" in Path("r.svg").read_text("utf-8")


def test_an_own_material_has_no_published_spread(run: Run, folder: MachineFolder) -> None:
    edit(folder, "tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500", 'material = "Al 7075 (HSS; dry)"')
    tap(folder, 1713.0)
    run("lobes", "m", "--figure", "published.svg")
    own = '[[material]]\nname = "Al 7075 (HSS; dry)"\ntangential_n_per_mm2 = 800\nradial_n_per_mm2 = 200\n\n[speed]'
    edit(folder, "[speed]", own)
    run("lobes", "m", "--figure", "own.svg")
    texts = [Path(name).read_text("utf-8") for name in ("published.svg", "own.svg")]
    assert ["range of published coefficients" in text for text in texts] == [True, False]


def test_the_verdicts_are_those_of_check_whatever_the_chart(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    program = ("lobes", "m", "--cut", "A: slot at 12 600 rpm", "--json", "--method")
    said = [json.loads(run(*program, method).out)["programs"] for method in ("zero-order", "semi-discretisation")]
    assert said[0] == said[1]
    checked = {one["name"]: one for one in json.loads(run("check", "m", "--json").out)["programs"]}
    for one in said[0]:
        assert {key: checked[one["name"]][key] for key in one} == one


def test_pockets_have_a_width(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    said = json.loads(run("lobes", "m", "--json").out)
    depths = dict(zip(said["speed_rpm"], said["depth_mm"], strict=True))
    for pocket in said["pockets_by_depth"]:
        assert pocket["from_rpm"] < pocket["speed_rpm"] < pocket["to_rpm"]
        inside = [deep for speed, deep in depths.items() if pocket["from_rpm"] <= speed <= pocket["to_rpm"]]
        assert min(inside) >= 0.8 * pocket["depth_mm"]
    best = said["pockets_by_depth"][0]
    text = f"{best['depth_mm']:.2f} mm at {best['speed_rpm']:.0f} ({best['from_rpm']:.0f}..{best['to_rpm']:.0f}) rpm"
    assert text in run("lobes", "m").out


def test_materials_are_listed_with_their_sources(run: Run, folder: MachineFolder) -> None:
    edit(
        folder,
        "[speed]",
        '[[material]]\nname = "ours"\nspecific_force_n_per_mm2 = 750\nforce_angle_deg = 68\n\n[speed]',
    )
    said = run("lobes", "m", "--materials").out
    assert "ours                                       Kt   695  Kr  281 N/mm²  machine.toml" in said
    assert "Al 6061-T6 (carbide; dry)                  Kt   244  Kr  114 N/mm²  low outlier: not a default" in said


def test_an_frf_beside_the_tip_is_refused(run: Run, folder: MachineFolder) -> None:
    folder = edit(folder, "position_mm = 0 ", "position_mm = 60 ")
    tap(folder, 1713.0)
    assert run("lobes", "m").code == 0
    said = run("lobes", "m", "--source", "frf")
    assert (said.code, "needs an FRF at the tool tip, but [tap] position_mm = 60" in said.err) == (2, True)
    assert "use --source modes" in said.err


def test_both_directions_count_from_the_frf_too(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0, stiffness=9e7)
    tap(folder, 1600.0, days=0.2, direction="y", stiffness=2e7)
    for days in (0.0, 400.0):
        if days:
            tap(folder, 1700.0, days, stiffness=9e7)
            tap(folder, 1590.0, days + 0.2, direction="y", stiffness=2e7)
        frf, modes = (json.loads(run("lobes", "m", "--source", name, "--json").out) for name in ("frf", "modes"))
        assert frf["minimum_depth_mm"] == pytest.approx(modes["minimum_depth_mm"], rel=0.01)
    assert frf["pocket_shifts"][-1]["speed_change"] == pytest.approx(
        modes["pocket_shifts"][-1]["speed_change"], abs=2e-3
    )


def test_now_is_compared_with_the_first_tests_of_the_same_directions(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1600.0, days=99.8, direction="y")
    tap(folder, 1690.0, days=200)
    run("lobes", "m", "--figure", "l.svg")
    drawn = Path("l.svg").read_text("utf-8")
    days = [f">{day}</text>" in drawn for day in ("2026-01-15", "2026-04-25", "2026-08-03")]
    assert days == [False, True, True]
    run("report", "m")
    html = Path("m/report.html").read_text("utf-8")
    assert "<h2>Stability lobes, then and now</h2>" in html
    assert "by zero order, x and y directions" in html


def test_pockets_are_compared_where_both_tops_are_known(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1700.0, days=300, stiffness=1.2e7)
    said = json.loads(run("lobes", "m", "--json").out)
    logbook = Logbook(folder)
    first = lobes_of(logbook.assembly(until=logbook.taps[0].id), folder.machine)["reference cut"]
    shifts = said["pocket_shifts"]
    assert len(shifts) >= 3
    for shift in shifts:
        top = float(first.depth_at(shift["then"]["speed_rpm"]))
        assert shift["then"]["depth_mm"] == pytest.approx(top * 1e3)
        assert shift["depth_change"] == pytest.approx(1.2 / 3.5 - 1, abs=0.05)


def test_the_report_says_what_check_says(run: Run, folder: MachineFolder) -> None:
    text = folder.toml.read_text("utf-8")
    cut = text.partition('name = "A: slot at 12 600 rpm"')[2]
    cut = cut[: cut.index("[[program]]")].replace("radial_depth_mm = 20", "radial_depth_mm = 10")
    added = ""
    for name, tool, speed, depth in (
        ("H", "reference", 23500, 50),
        ("P", "long end mill", 12600, 0.2),
        ("U", "T9", 9e3, 1),
    ):
        own = cut.replace('"reference"', f'"{tool}"').replace("speed_rpm = 12600", f"speed_rpm = {speed}")
        added += f'[[program]]\nname = "{name}"' + own.replace("depth_mm = 6.0", f"depth_mm = {depth}")
    head, tail = text[: text.index("[[program]]")], text[text.index("# The spindle of the example") :]
    folder.toml.write_text(f"{head}{added}\n{tail}", "utf-8")
    folder = MachineFolder(folder.path)
    tap(folder, 1541.7)
    said = {entry["name"]: entry for entry in json.loads(run("check", "m", "--json").out)["programs"]}
    zero = lobes_of(Logbook(folder).assembly(), folder.machine)["H"].depth_at(23500) * 1e3
    assert said["H"]["limit_mm"] < 50 < zero
    run("report", "m")
    html = Path("m/report.html").read_text("utf-8")
    rows = {row.partition("<")[0]: row.partition("</tr>")[0] for row in html.split("<tr><td>")}
    for name in "HP":
        assert f"<td>{said[name]['limit_mm']:.2f}" in rows[name]
        assert ("✗ not stable" in rows[name]) == (not said[name]["stable"])
    assert "predicted" in rows["P"]
    assert "predicted" not in rows["H"]
    assert "not checked: no tap test with tool &#39;T9&#39;" in rows["U"]
    assert "not stable" in html[: html.index("<table>")]
    assert "U: not checked" in html
    assert "average tooth angle" not in html
    assert "by semi-discretisation" in html
    assert "Limit of the reference cut by zero order" in html


def test_a_predicted_diagram_says_so_and_is_no_waterfall(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    assert run("lobes", "m", "--tool", "long end mill", "--figure", "p.svg").code == 0
    drawn = Path("p.svg").read_text("utf-8")
    assert drawn.count("predicted, bearings of 2026-01-15</text>") == 1
    assert "zero order, predicted, bearings of 2026-01-15, from the modes" in drawn
    assert "95 % band" not in drawn
    said = run("lobes", "m", "--tool", "long end mill", "--figure", "q.svg", "--waterfall", "w.svg")
    assert (said.code, "--waterfall shows measured lobes" in said.err) == (2, True)
    assert not Path("q.svg").exists()


def test_low_immersions_are_noted_once_and_where_they_concern(run: Run, folder: MachineFolder) -> None:
    folder = edit(folder, "radial_depth_mm = 20 ", "radial_depth_mm = 2 ")
    tap(folder, 1713.0)
    note = "zero order knows no flip lobes"
    said = run("lobes", "m").out
    assert (said.count(note), "stability_boundary" in said) == (1, False)
    assert note not in run("lobes", "m", "--cut", "A: slot at 12 600 rpm").out
    assert note not in run("lobes", "m", "--method", "semi-discretisation").out
    said = run("lobes", "m", "--cut", "A: slot at 12 600 rpm", "--radial", "r.svg").out
    assert said.count(f"--radial: {note}") == 1
    assert note in Path("r.svg").read_text("utf-8")


def test_a_cut_without_limit_is_said_to_have_none(run: Run, folder: MachineFolder) -> None:
    folder = edit(folder, "radial_n_per_mm2 = 500", "radial_n_per_mm2 = 0")
    for days in (0.0, 300.0):
        tap(folder, 1713.0 - days / 10, days)
        said = run("lobes", "m", "--figure", "l.svg")
        assert said.code == 0, said.err
        assert "no limit in this speed range (zero order)" in said.out
        assert not any(word in said.out for word in ("nan", "inf ", "pocket"))
    assert run("lobes", "m", "--radial", "r.svg", "--waterfall", "w.svg").code == 0
    assert run("report", "m").code == 0
    assert "has no limit in this speed range (zero order)" in Path("m/report.html").read_text("utf-8")


def test_an_unknown_ending_names_those_that_are_known(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    said = run("lobes", "m", "--figure", "l.xyz")
    assert (said.code, "name a file that ends in .svg, .png or .pdf" in said.err) == (2, True)
    assert "webp" not in said.err


EXAMPLE = """
[machine]
name = "m"
[[material]]
name = "ours"
tangential_n_per_mm2 = 800
radial_n_per_mm2 = 200
[reference_cut]
teeth = 2
radial_depth_mm = 5
tool_diameter_mm = 10
direction = "up"
helix_deg = 30
material = "ours"
"""


def test_own_and_published_materials() -> None:
    machine = parse_machine(EXAMPLE)
    assert machine.reference_cut is not None
    cut = machine.build_cut(machine.reference_cut)
    assert (cut.tangential, cut.radial, cut.immersion) == (800e6, 200e6, 0.5)
    assert cut.helix_lag == pytest.approx(2 * np.tan(np.radians(30)) / 0.01)
    steel = parse_machine(EXAMPLE.replace('material = "ours"', 'material = "Steel (textbook)"'))
    assert steel.reference_cut is not None
    assert steel.build_cut(steel.reference_cut).tangential == pytest.approx(2173.3e6)
    assert steel.settings_hash != machine.settings_hash


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('material = "ours"', 'material = "our"', "material='our' is not known; is 'ours' meant"),
        ('material = "ours"', "", "give either material or both"),
        ('material = "ours"', 'material = "ours"\nradial_n_per_mm2 = 1', "give either material or both"),
        ('material = "ours"', "tangential_n_per_mm2 = 1", "give either material or both"),
        ("tangential_n_per_mm2 = 800\n", "", "give either tangential_n_per_mm2 and radial_n_per_mm2"),
        ("radial_n_per_mm2 = 200", "radial_n_per_mm2 = 200\nforce_angle_deg = 60", "give either tangential"),
        ("helix_deg = 30", "helix_deg = 90", "helix_deg"),
        ("teeth = 2", "teeth = 2\nfeed_per_tooth_mm = 0", "feed_per_tooth_mm"),
        ("[reference_cut]", "[drive]\npower_kw = 0\n[reference_cut]", "drive power_kw"),
    ],
)
def test_bad_materials_are_told_with_their_place(old: str, new: str, message: str) -> None:
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        parse_machine(EXAMPLE.replace(old, new))


def test_maps_stand_where_the_numbers_say(folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1650.0, days=200)
    history = Logbook(folder).history
    depth = np.stack([row.depth["reference cut"] for row in history.rows])
    figure = waterfall_figure(history.speed_rpm, [START, START + timedelta(days=200)], depth, "t")
    (mesh,) = figure.axes[0].collections
    shown = np.asarray(mesh.get_array()).reshape(depth.shape)
    low = shown < 0.99 * shown.max()
    np.testing.assert_allclose(shown[low], depth[low] * 1e3)

    modes = [Mode(1713.0, 0.03, 3.5e7)]
    found = radial_lobes(
        lambda cut: stability_boundary(modes, None, cut, np.linspace(9000, 15000, 5), 0.1),
        Cut(4, 1, "up", 1e9, 3e8),
        [0.5, 1],
    )
    axes = radial_figure(found, 0.02, 0.75).axes[0]
    assert axes.get_ylim() == pytest.approx((10.0, 20.0))
    assert np.asarray(axes.lines[0].get_ydata()) == pytest.approx(15.0)


def test_bands_and_pockets_are_drawn() -> None:
    speed = np.linspace(1000.0, 2000.0, 5)
    depth = np.full(5, 2e-3)
    figure = lobes_figure(
        speed,
        {"now": depth},
        band=DepthBand(0.9 * depth, 1.1 * depth),
        spread=DepthBand(0.5 * depth, 2 * depth),
        pockets=[Pocket(1500.0, 2e-3, 1400.0, 1650.0)],
    )
    for collection, edges in zip(figure.axes[0].collections, ((1.0, 4.0), (1.8, 2.2)), strict=False):
        heights = np.asarray(collection.get_paths()[0].vertices)[:, 1]
        assert (heights.min(), heights.max()) == pytest.approx(edges)
    assert any("1500 rpm" in text.get_text() for text in figure.axes[0].texts)
    assert any(list(np.asarray(line.get_xdata())) == [1400.0, 1650.0] for line in figure.axes[0].lines)
