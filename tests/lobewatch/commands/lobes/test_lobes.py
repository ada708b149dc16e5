"""`lobewatch lobes`: methods, uncertainty band, figures."""

from __future__ import annotations

import json
import re
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id
from lobes import Cut, radial_lobes, stability_boundary
from lobewatch.history.history import compute_row_lobes
from lobewatch.logbook import Logbook, compare_lobes
from lobewatch.machine.folder import MachineFolder
from lobewatch.show.figures.lobe_figures import BAND_LABEL, plot_radial_map, plot_waterfall
from lobewatch.tool import DynamicsSource, LobeMethod, compute_lobe_chart, compute_lobes, speed_grid
from lobewatch.verdicts.monte_carlo import compute_limit_band
from lobewatch.verdicts.verdict import find_open_question
from modal import Mode, synthesize_frf
from tests.lobewatch.commands.conftest import Run
from tests.lobewatch.commands.lobes.conftest import START, edit, tap


def test_methods_and_shifts(run: Run, folder: MachineFolder) -> None:
    edit(folder, "steps = 300", "steps = 120")
    tap(folder, 1713.0)
    tap(folder, 1713.0 * 0.95, days=300)
    zero, angle, semi = (
        json.loads(run("lobes", "m", "--json", "--method", method).out)
        for method in ("zero-order", "average-angle", "semi-discretisation")
    )
    assert [one["method"] for one in (zero, angle, semi)] == ["zero order", "average angle", "semi-discretisation"]
    assert zero["minimum_depth_mm"] == pytest.approx(semi["minimum_depth_mm"], rel=0.02)
    assert re.search(r"\d+ to \d+ .*16", semi["method_detail"])
    shifts = zero["pocket_shifts"]
    assert len(shifts) >= 3
    step = 21000 / 119
    for shift in shifts:
        moved = shift["now"]["speed_rpm"] - 0.95 * shift["then"]["speed_rpm"]
        assert abs(moved) <= 1.1 * step
        assert shift["speed_change"] == pytest.approx(shift["now"]["speed_rpm"] / shift["then"]["speed_rpm"] - 1)
    said = run("lobes", "m", "--source", "frf", "--method", "semi-discretisation")
    assert (said.code, "--source frf" in said.err) == (2, True)


def relative_width(folder: MachineFolder) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the relative width of the band around the line of the reference cut, at each speed."""
    assembly = Logbook(folder).assembly()
    line = compute_lobes(assembly, folder.machine)["reference cut"]
    band = compute_limit_band(line, "reference cut", assembly, folder.machine)
    assert np.all(band.low <= line.depth)
    assert np.all(line.depth <= band.high)
    return np.asarray((band.high - band.low) / line.depth)


SURE = """[doubt]
frequency_percent = 0
damping_percent = 0
stiffness_percent = 0
speed_percent = 0
coefficients_percent = 0

[speed] """


def test_the_band_is_as_wide_as_the_uncertainty(folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1690.0, days=0.2, direction="y")
    edit(folder, "[speed] ", SURE)
    steps = [("= 0\n\n", "= 0\n\n"), ("= 0\n\n", "= 10\n\n"), ("= 10\n\n", "= 20\n\n")]
    widths = [relative_width(edit(folder, *(f"coefficients_percent {side}" for side in step))) for step in steps]
    assert np.max(widths[0]) < 0.01
    slow = slice(0, 30)
    for width, share in zip(widths[1:], (0.1, 0.2), strict=True):
        least, most = 1.0 / (1 + share), 1.0 / (1 - share)
        assert np.median(width[slow]) == pytest.approx(most - least, rel=0.25)
        assert np.all(width < 2 * (most - least))
    published = edit(folder, "tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500", 'material = "Al 7075 (HSS; dry)"')
    assert np.median(relative_width(published)) > 1.5 * np.median(widths[-1])


@pytest.mark.parametrize("method", [LobeMethod.AVERAGE_ANGLE, LobeMethod.SEMI_DISCRETISATION])
def test_the_band_belongs_to_the_line_of_any_method(folder: MachineFolder, method: LobeMethod) -> None:
    folder = edit(folder, "steps = 300", "steps = 80")
    tap(folder, 1713.0)
    tap(folder, 1690.0, days=0.2, direction="y")
    assembly = Logbook(folder).assembly()
    lines = [
        compute_lobe_chart(
            one, assembly.x, assembly.y, folder.machine.cuts("reference")["reference cut"], speed_grid(folder.machine)
        )
        for one in (LobeMethod.ZERO_ORDER, method)
    ]
    bands = [compute_limit_band(line, "reference cut", assembly, folder.machine) for line in lines]
    zero, other = (np.stack((band.low, band.high)) / line.depth for band, line in zip(bands, lines, strict=True))
    np.testing.assert_allclose(np.median(other, axis=1), np.median(zero, axis=1), rtol=0.1)


def test_pictures(run: Run, folder: MachineFolder) -> None:
    edit(folder, "steps = 300", "steps = 60")
    tap(folder, 1713.0)
    said = run("lobes", "m", "--figure", "l.png", "--radial", "r.svg", "--waterfall", "w.png")
    assert said.code == 0, said.err
    assert Path("l.png").read_bytes().startswith(b"\x89PNG")
    assert Path("w.png").read_bytes().startswith(b"\x89PNG")
    assert "radial depth ae (mm)" in Path("r.svg").read_text("utf-8")


def test_both_directions_count_from_the_frf_too(folder: MachineFolder) -> None:
    tap(folder, 1713.0, stiffness=9e7)
    tap(folder, 1600.0, days=0.2, direction="y", stiffness=2e7)
    tap(folder, 1700.0, 400.0, stiffness=9e7)
    book = Logbook(folder)
    frf = compare_lobes(book, None, "reference cut", DynamicsSource.FRF, LobeMethod.ZERO_ORDER)
    assert "older-direction" in [remark.code for remark in frf.remarks]
    modes = compute_lobes(book.assembly(), folder.machine)["reference cut"]
    np.testing.assert_allclose(frf.now.lobes.depth, modes.depth, rtol=0.03)


def test_now_is_compared_with_the_first_tests_of_the_same_directions(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1600.0, days=99.8, direction="y")
    tap(folder, 1690.0, days=200)
    run("lobes", "m", "--figure", "l.svg")
    drawn = Path("l.svg").read_text("utf-8")
    assert [f">{day}" in drawn for day in ("2026-01-15", "2026-04-25", "2026-08-03<")] == [
        False,
        True,
        True,
    ]
    run("report", "m")
    html = Path("m/report.html").read_text("utf-8")
    assert '<section id="stability-lobes"' in html
    assert "x and y directions" in html
    assert BAND_LABEL in html


def test_a_predicted_diagram_says_so_and_is_no_waterfall(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    assert run("lobes", "m", "--tool", "long end mill", "--figure", "p.svg").code == 0
    drawn = Path("p.svg").read_text("utf-8")
    assert "predicted" in drawn
    assert "2026-01-15" in drawn
    said = run("lobes", "m", "--tool", "long end mill", "--figure", "q.svg", "--waterfall", "w.svg")
    assert (said.code, "--waterfall: " in said.err) == (2, True)
    assert not Path("q.svg").exists()


def test_a_cut_without_limit_is_reported_to_have_none(run: Run, folder: MachineFolder) -> None:
    folder = edit(folder, "radial_n_per_mm2 = 500", "radial_n_per_mm2 = 0")
    for days in (0.0, 300.0):
        tap(folder, 1713.0 - days / 10, days)
        said = run("lobes", "m", "--method", "average-angle", "--figure", "l.svg")
        assert said.code == 0, said.err
        assert "no stability limit" in said.out
        assert not any(word in said.out.replace("no stable pocket", "") for word in ("nan", "inf ", "pocket"))
    assert run("lobes", "m", "--method", "average-angle", "--radial", "r.svg", "--waterfall", "w.svg").code == 0


def test_the_verdicts_are_those_of_check_whatever_the_chart(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    program = ("lobes", "m", "--cut", "A: slot at 12 600 rpm", "--json", "--method")
    said = [json.loads(run(*program, method).out)["programs"] for method in ("zero-order", "semi-discretisation")]
    assert said[0] == said[1]
    checked = {one["name"]: one for one in json.loads(run("check", "m", "--json").out)["programs"]}
    for one in said[0]:
        assert {key: checked[one["name"]][key] for key in one} == one


def test_an_frf_next_to_the_tip_is_rejected(run: Run, folder: MachineFolder) -> None:
    folder = edit(folder, "position_mm = 0 ", "position_mm = 60 ")
    tap(folder, 1713.0)
    assert run("lobes", "m").code == 0
    said = run("lobes", "m", "--source", "frf")
    assert (said.code, "position_mm = 60" in said.err) == (2, True)
    assert "--source modes" in said.err


def test_low_immersions_are_noted_once_and_where_they_concern(run: Run, folder: MachineFolder) -> None:
    folder = edit(folder, "radial_depth_mm = 20 ", "radial_depth_mm = 2 ")
    tap(folder, 1713.0)
    note = "limit may be too high"
    said = run("lobes", "m").out
    assert (said.count(note), "stability_boundary" in said) == (1, False)
    assert note not in run("lobes", "m", "--cut", "A: slot at 12 600 rpm").out
    assert note not in run("lobes", "m", "--method", "semi-discretisation").out
    said = run("lobes", "m", "--cut", "A: slot at 12 600 rpm", "--radial", "r.svg").out
    assert re.search(rf"--radial\b.*{note}", said)
    assert note in Path("r.svg").read_text("utf-8")


def test_an_unknown_ending_names_those_that_are_known(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    said = run("lobes", "m", "--figure", "l.xyz")
    assert (said.code, ".svg, .png or .pdf" in said.err) == (2, True)
    assert "webp" not in said.err


def test_maps_stand_where_the_numbers_say(folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1650.0, days=200)
    history = Logbook(folder).history
    depth = np.stack([compute_row_lobes(row, folder.machine)["reference cut"].depth for row in history.rows])
    figure = plot_waterfall(speed_grid(folder.machine), [START, START + timedelta(days=200)], depth, "t")
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
    axes = plot_radial_map(found, 0.02, 0.75).axes[0]
    assert axes.get_ylim() == pytest.approx((10.0, 20.0))
    assert np.asarray(axes.lines[0].get_ydata()) == pytest.approx(15.0)


def test_the_chart_of_the_frf_is_that_of_the_fitted_frf(folder: MachineFolder) -> None:
    lines, modes = np.arange(1.0, 4000.0), [Mode(1400.0, 0.02, 3e7), Mode(1800.0, 0.02, 6e7)]
    exact = synthesize_frf(modes, lines).accelerance
    for days, delay in enumerate([0.0, 1e-4]):
        when = START + timedelta(days=days)
        about = Circumstances("m", when, "reference", "x", "", folder.toml.read_text("utf-8"))
        measured = exact * np.exp(-2j * np.pi * lines * delay)
        folder.commit(TapTest(new_tap_id(about), about, from_accelerance(lines, measured)))
    logbook = Logbook(folder)
    measurement = logbook.measurement(logbook.assembly().taps["x"])
    assert "response-delay-removed" in {remark.code for remark in measurement.remarks}
    found = compare_lobes(logbook, None, "reference cut", DynamicsSource.FRF, LobeMethod.ZERO_ORDER)
    assert found.then is not None
    assert found.now.lobes.minimum.depth == pytest.approx(found.then.lobes.minimum.depth, rel=1e-3)
    assert found.now.lobes.depth == pytest.approx(found.then.lobes.depth, rel=0.02)


def test_missing_pockets_have_the_reason_and_remedy_of_the_recommendation(folder: MachineFolder) -> None:
    tap(folder, 1541.7)
    tap(folder, 1560.0, days=0.2, direction="y")
    tap(folder, 1250.0, days=1)
    logbook = Logbook(folder)
    found = compare_lobes(logbook, None, "reference cut", DynamicsSource.MODES, LobeMethod.ZERO_ORDER)
    assert found.now.assembly.directions == ("x", "y")
    question = find_open_question(found.now.table, found.now.assembly)
    assert question is not None
    (remark,) = [remark for remark in found.remarks if remark.code == "no-safe-pocket"]
    assert found.pockets == []
    assert (question[0] in remark.text, remark.cure) == (True, question[1])
