"""machine.toml: parsed values, and every mistake reported with its place."""

from __future__ import annotations

import math
import re
from importlib import resources
from pathlib import Path

import msgspec
import pytest

from acquisition import DataError
from dsm import MATERIALS
from lobewatch.machine.settings.cut_tables import UncertaintyTable
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, parse_machine_file, read_machine_file
from lobewatch.machine.settings.setting_questions import find_all_questions, hash_programs
from lobewatch.verdicts.uncertainty import DEFAULT_TAP_SCATTER

pytestmark = pytest.mark.quick

EXAMPLE = resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
FRESH = resources.files("sim_data").joinpath("new_machine.toml").read_text("utf-8")


def test_the_example_is_the_surrogate_in_si() -> None:
    machine = parse_machine_file(EXAMPLE)
    assert machine.spindle is not None
    assert "surrogate" in machine.spindle.label
    spindle = machine.spindle.build()
    assert (len(spindle.segments), len(spindle.bearings)) == (26, 10)
    assert spindle.segments[6].length == pytest.approx(17.5e-3)
    assert spindle.segments[6].outer_diameter == pytest.approx(78e-3)
    assert spindle.segments[6].bore_diameter == pytest.approx(30e-3)
    assert spindle.bearings[0].position == pytest.approx(166e-3)
    assert spindle.bearings[0].stiffness == pytest.approx(1.28e9)
    assert (spindle.youngs_modulus, spindle.density) == (210e9, 7850.0)
    cut, across = machine.cuts("reference")["A: slot at 12 600 rpm"]
    assert (cut.teeth, cut.immersion, cut.direction, cut.tangential, cut.radial) == (4, 1.0, "down", 1400e6, 500e6)
    assert [cut.feed_angle, across.feed_angle] == pytest.approx([0.0, math.pi / 2])


def test_a_fresh_machine_needs_no_spindle() -> None:
    machine = parse_machine_file(FRESH)
    assert machine.spindle is None
    assert machine.tap.hits == 10
    assert list(machine.cuts("anything")) == [REFERENCE_CUT]


def test_a_table_that_is_left_out_says_what_the_fresh_machine_file_says() -> None:
    fresh, bare = parse_machine_file(FRESH), parse_machine_file('[machine]\nname = "m"\n')
    for table in ("tap", "daq", "mode", "limits", "speed", "drive", "doubt", "notify"):
        assert getattr(bare, table) == getattr(fresh, table), table


@pytest.mark.parametrize("text", [EXAMPLE, FRESH], ids=["example", "fresh"])
def test_the_uncertainty_in_comments_is_the_default_and_complete(text: str) -> None:
    block = text[text.index("# [doubt]") :].partition("\n\n")[0]
    shown = parse_machine_file('[machine]\nname = "m"\n' + re.sub("^# ", "", block, flags=re.MULTILINE)).doubt
    own = {"frequency_percent": 0.3, "damping_percent": 10.0, "stiffness_percent": 3.0}
    assert msgspec.structs.asdict(shown) == msgspec.structs.asdict(UncertaintyTable()) | own
    assert pytest.approx([value / 100 for value in own.values()]) == DEFAULT_TAP_SCATTER[:3]
    assert len(re.findall(r"^# \w+ = \S+ +# \S", block, re.MULTILINE)) == len(UncertaintyTable.__struct_fields__)


@pytest.mark.parametrize("text", [EXAMPLE, FRESH], ids=["example", "fresh"])
@pytest.mark.parametrize("key", ['feed = "both"', "flute_length_mm = 40", "helix_deg = 30", "feed_per_tooth_mm = 0.1"])
def test_optional_keys_of_a_program_are_shown_and_right(text: str, key: str) -> None:
    assert re.search(rf"^# {re.escape(key)}", text, re.MULTILINE)
    changed = parse_machine_file(EXAMPLE.replace('direction = "down"\n', f'direction = "down"\n{key}\n', 2))
    assert str(getattr(changed.program[0], key.partition(" ")[0])).rstrip(".0") in key


def test_what_the_fresh_machine_file_shows_in_comments_is_right() -> None:
    start = FRESH.index("# [spindle]")
    shown = "\n".join(line.removeprefix("#").removeprefix(" ") for line in FRESH[start:].splitlines())
    text = shown.replace("A tool that is not tapped", "# A tool")
    machine = parse_machine_file(FRESH[:start] + text)
    spindle = machine.model("reference")
    assert spindle.theory == "timoshenko"
    assert spindle.segments[0].material == MATERIALS["carbide"]
    assert spindle.segments[0].mass_diameter == pytest.approx(0.018)
    assert spindle.segments[1].diameters_at(1.0) == pytest.approx((0.06, 0.02))
    assert spindle.shear_modulus == pytest.approx(80.8e9)
    front, damped, rear = spindle.bearings
    assert (front.stiffness, front.group, front.housing_stiffness) == (500e6, "front", math.inf)
    assert (damped.damping, damped.rotational_stiffness) == (500.0, 1e4)
    assert (rear.stiffness, rear.housing_stiffness) == pytest.approx((200e6, 800e6))
    (pulley,), (taper,) = spindle.masses, spindle.joints
    assert (pulley.mass, pulley.diametral_inertia, pulley.polar_inertia) == pytest.approx((2.1, 3e-3, 5.5e-3))
    assert (taper.stiffness, taper.rotational_stiffness, taper.group) == (2e9, 1e6, "taper")
    short = machine.model("end mill 12")
    assert short.length == pytest.approx(spindle.length - 0.010)
    assert short.bearings[0].position == pytest.approx(0.150)
    with pytest.raises(DataError, match=r"'end mill 13' .*'reference', 'end mill 12'"):
        machine.model("end mill 13")


def with_elastic_constants(lines: str) -> str:
    """Return the example without its material, and with these lines in [spindle]."""
    return EXAMPLE.replace("youngs_modulus_gpa = 210.0\n", lines)


def test_an_orthotropic_shaft_has_a_poisson_ratio_of_its_own() -> None:
    carbon = with_elastic_constants("youngs_modulus_gpa = 120\nshear_modulus_gpa = 5\naxial_poisson_ratio = 0.3\n")
    machine = parse_machine_file(carbon)
    material = machine.model("reference").material
    assert (material.youngs_modulus, material.shear_modulus, material.poisson_ratio) == (120e9, 5e9, 0.3)
    assert not [question for question in find_all_questions(machine) if question.location == "[spindle]"]
    assert b"axial_poisson_ratio" not in msgspec.json.encode(parse_machine_file(EXAMPLE).spindle)
    assert machine.settings_hash != parse_machine_file(carbon.replace("= 0.3\n", "= 0.2\n", 1)).settings_hash


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("shear_modulus_gpa = 300\n", r"Poisson's ratio -0\.65.*theory"),
        ("shear_modulus_gpa = 60\n", r"Poisson's ratio 0\.75.*axial_poisson_ratio"),
        ("axial_poisson_ratio = -0.1\n", "spindle axial_poisson_ratio"),
        ("axial_poisson_ratio = 0.6\n", "spindle axial_poisson_ratio"),
    ],
)
@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_impossible_elastic_constants_are_rejected(lines: str, message: str, theory: str) -> None:
    text = with_elastic_constants("youngs_modulus_gpa = 210\n" + lines)
    with pytest.raises(DataError, match=message):
        parse_machine_file(text.replace('theory = "euler-bernoulli"', f'theory = "{theory}"'))


def test_measured_coefficients_next_to_a_material_count_and_leave_it_its_group() -> None:
    machine = parse_machine_file(EXAMPLE.replace("tangential_n_per_mm2", 'material = "C45"\ntangential_n_per_mm2'))
    known = machine.coefficients(machine.program[0])
    assert (known.tangential, known.radial, known.iso_group) == (1400e6, 500e6, "P")
    assert known.tangential_range is None
    assert known.source == "machine.toml"


def test_programs_belong_to_their_tool() -> None:
    machine = parse_machine_file(EXAMPLE.replace('tool = "reference"\nteeth', 'tool = "T7"\nteeth', 1))
    assert "A: slot at 12 600 rpm" not in machine.cuts("reference")
    assert list(machine.cuts("T7")) == [REFERENCE_CUT, "A: slot at 12 600 rpm"]


@pytest.mark.parametrize(
    ("old", "new", "facts"),
    [
        ("trigger_n = 20", "triger_n = 20", "tap: .*'triger_n'.* 'trigger_n'"),
        ("direction =", 'feet = "x"\ndirection =', "reference_cut: .*'feet'.* 'feed'"),
        ("direction =", "speed_rpm = 1\ndirection =", "reference_cut: .*'speed_rpm'"),
        ("bearing_stiffness_n_per_um", "helix_deg", "spindle: .*'helix_deg'"),
        ("outer_mm = 31.5", "outter_mm = 31.5", "spindle segment 1: .*'outter_mm'.* 'outer_mm'"),
        ("bore_mm = 30.0", "bore_mm = 78.0", "spindle segment 7: bore_mm=78 .*outer_mm=78"),
        ("length_mm = 26.5", "length_mm = 0", "spindle segment 1 length_mm: .*> 0.0.* 0$"),
        ("length_mm = 26.5", "length_mm = -3", "spindle segment 1 length_mm: .*number > 0.0.* -3$"),
        ("length_mm = 26.5", 'length_mm = "26.5"', "spindle segment 1 length_mm: .*number.* text"),
        ("length_mm = 26.5", "length_mm = 26,5", r".*at line \d+.* 26\.5 "),
        ("high_rpm = 24000", "high_rpm = 24,000", r".*at line \d+.* 24 or 24000 "),
        ("high_rpm = 24000", "high_rpm = 24'000", r".*at line \d+.* 24000 "),
        ("high_rpm = 24000", "high_rpm = 24 000", r".*at line \d+.* 24000 "),
        ("length_mm = 26.5", "length_mm = nan", "length_mm"),
        ("teeth = 4", "pitch_deg = [85, 95, 85, 96]\nteeth = 4", r"reference_cut: .*\[85, 95, 85, 96\].* 361"),
        ("teeth = 4", "pitch_deg = [120, 120, 120]\nteeth = 4", "3 angles for 4 "),
        ("teeth = 4", "helix_deg = -30\nteeth = 4", "reference_cut helix_deg: .*>= 0.0.* -30.* 90 deg"),
        ("radial_depth_mm = 20 ", "radial_depth_mm = [12, 4] ", r"radial_depth_mm=\[12, 4\] .*smallest, largest"),
        ("radial_depth_mm = 20 ", "radial_depth_mm = [4] ", "reference_cut radial_depth_mm: .*list.* 2"),
        ("radial_depth_mm = 20 ", "radial_depth_mm = [4, 21] ", "radial_depth_mm=21 .*tool_diameter_mm=20"),
        ("speed_rpm = 12600", "speed_rpm = 12600\ncorner_radius_mm = 9", "program 1: corner_radius_mm=9 .* 10 mm"),
        (
            "speed_rpm = 12600",
            'speed_rpm = 12600\nwear = "blunt"',
            "program 1 wear: .*'blunt'.* 'new', 'used', 'worn'",
        ),
        ('name = "long end mill"', 'name = "T"\npitch_deg = [90, 90]', r"tool 1: .*\[90, 90\].* 180 deg"),
        ("position_mm = 166", "position_mm = 16600", "bearing 1: position_mm=16600 .*0 to 672 mm"),
        ("radial_depth_mm = 20 ", "radial_depth_mm = 25 ", "reference_cut: radial_depth_mm=25 .*=20"),
        ('direction = "down"', 'direction = "climb"', "direction: .*'climb'.* 'up', 'down'"),
        ("speed_rpm = 12600", "speed_rpm = 12600\nhelix_deg = -30", "program 1 helix_deg: .* -30.* 90 deg"),
        (
            'name = "long end mill"',
            'name = "long end mill"\ntool_material = "carbid"',
            "tool 1 tool_material: .*'carbid'.* 'HSS', 'carbide', 'coated carbide', 'PCD', 'CBN'.* 'carbide'",
        ),
        ("band_hz = [1200, 2200]", "band_hz = [2200, 1200]", r"mode: band_hz=\[2200.0, 1200.0\] .*lowest, highest"),
        ("speed_rpm = 12600", "speed_rpm = 126000", r"program 1: speed_rpm=126000 .*\[speed\] 3000..24000 rpm"),
        ("high_rpm = 24000", "high_rpm = 500", "speed: low_rpm=3000 .*high_rpm=500"),
        ("high_rpm = 24000", "high_rpm = 3000", "speed: low_rpm=3000 .*high_rpm=3000.* 2970 and 3030"),
        ("hits = 10", "hits = 1", "tap hits: .*whole number >= 3.* 1$"),
        ("B: slot at 6 200 rpm", "A: slot at 12 600 rpm", "program 2: .*'A: slot at 12 600 rpm'.* unique"),
        ('name = "MACHINE_NAME"', 'name = ""', "machine name: "),
        ("[machine]", "[machin]", "'machin'.* 'machine'"),
        ("[machine]", "[machine", ".*at line 2"),
        (
            'theory = "euler-bernoulli"',
            'theory = "rayleigh"',
            "spindle theory: .*'rayleigh'.* 'euler-bernoulli', 'timoshenko'",
        ),
        (
            "outer_mm = 31.5",
            'material = "carbid", outer_mm = 31.5',
            "spindle segment 1: .*'carbid'.* steel, .*'carbide'",
        ),
        ("outer_mm = 31.5", "end_bore_mm = 40, outer_mm = 31.5", "segment 1: end_bore_mm=40 .*end_outer_mm=31.5"),
        ("outer_mm = 31.5", "mass_outer_mm = -1, outer_mm = 31.5", "spindle segment 1 mass_outer_mm: .* -1$"),
        ("position_mm = 203.5 ", "position_mm = 166 ", "bearing 2: position=0.166 m .*bearing 1"),
        ("tool_length_mm = 93.5", "tool_length_mm = 935", "tool_length_mm=935 .* 166 mm"),
        ("tool_length_mm = 93.5", "", r"tool 1: tool_length_mm .*\[spindle\].*'reference'"),
        ('name = "long end mill"', 'name = "reference"', r"tool 1: .*segments of 'reference'.* \[tap\]"),
        ("outer_mm = 17.0", "outer_mm = 0", "tool 1 segment 1 outer_mm: .*> 0.0.* 0$"),
        ("band_hz = [1200, 2200]", "band_hz = [1200, -1]", "mode band_hz 2: .*> 0.0.* -1$"),
        ("mass_outer_mm = 18.0", "mass_outer_mm = 18.0, end_outer_mm = 16", "tool 1.*segment 1: .*0.018 m"),
        ("position_mm = 0 ", "position_mm = 5000 ", "tap: position_mm=5000 .*0 to 672 mm"),
        ("tool_length_mm = 93.5", "tool_length_mm = 200", "tool_length_mm=200 .* 166 mm"),
        ("high_rpm = 24000", "high_rpm = inf", "speed high_rpm: .*<= 1"),
        ("depth_mm = 2.5", "depth_mm = inf", "program 1 depth_mm: .*<= 1"),
    ],
)
def test_every_mistake_is_reported_with_its_place(old: str, new: str, facts: str) -> None:
    assert old in EXAMPLE
    with pytest.raises(DataError, match=rf"^machine\.toml: (.* )?{facts}") as caught:
        parse_machine_file(EXAMPLE.replace(old, new, 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("escaped", ["\\u001b", "\\u0000", "\\n", "\\t", "\\u007f", "\\u009b", "\\u2028"])
@pytest.mark.parametrize(
    ("old", "place"),
    [
        ('name = "MACHINE_NAME"', "machine: name='x"),
        ('tool = "reference"', "tap: tool='x"),
        ('name = "A: slot at 12 600 rpm"', "program 1: name='x"),
        ('name = "long end mill"', "tool 1: name='x"),
        ("length_mm = 26.5", "spindle: segment 1: material='x"),
    ],
)
def test_control_characters_in_names_are_rejected_with_their_place(old: str, place: str, escaped: str) -> None:
    key = old.split(" ")[0].replace("length_mm", "material")
    with pytest.raises(DataError) as caught:
        parse_machine_file(EXAMPLE.replace(old, f'{key} = "x{escaped}y"', 1))
    assert str(caught.value).startswith(f"machine.toml: {place}")
    assert "control character '\\" in str(caught.value)
    assert str(caught.value).isprintable()


def test_control_characters_in_a_material_are_rejected() -> None:
    material = '[[material]]\nname = "soft\\u001b"\ntangential_n_per_mm2 = 1500\nradial_n_per_mm2 = 500\n'
    with pytest.raises(DataError, match=r"material 1: name='soft.*control character"):
        parse_machine_file(f"{EXAMPLE}\n{material}")


def test_materials_have_names_of_their_own() -> None:
    material = '[[material]]\nname = "my steel"\ntangential_n_per_mm2 = 1500\nradial_n_per_mm2 = 500\n'
    assert len(parse_machine_file(f"{EXAMPLE}\n{material}").material) == 1
    with pytest.raises(DataError, match=r"material 2: .*'my steel'"):
        parse_machine_file(f"{EXAMPLE}\n{material}{material}")


def test_a_file_that_is_no_text_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_bytes(EXAMPLE.replace("SURROGATE", "SURROGÄTE").encode("latin-1"))
    with pytest.raises(DataError, match=r"machine\.toml: .*UTF-8 at byte \d+"):
        read_machine_file(path)


def test_hashes_change_with_what_a_history_depends_on_and_with_nothing_else() -> None:
    machine = parse_machine_file(EXAMPLE)
    for old, new, same, same_words in (
        ("# tap_interval_days = 30", "tap_interval_days = 60", True, True),
        ("depth_mm = 2.5", "depth_mm = 2.0", True, False),
        ("bearing_stiffness_n_per_um = 1280.0", "bearing_stiffness_n_per_um = 1000.0", False, True),
        ("band_hz = [1200, 2200]", "band_hz = [1200, 2300]", False, True),
        ("high_rpm = 24000", "high_rpm = 20000", True, True),
        ("[speed]", "[doubt]\nspeed_percent = 2\n\n[speed]", True, False),
    ):
        assert old in EXAMPLE
        changed = parse_machine_file(EXAMPLE.replace(old, new))
        assert (changed.settings_hash == machine.settings_hash) is same
        assert (hash_programs(changed) == hash_programs(machine)) is same_words


def test_a_further_program_of_a_described_tool_changes_no_result_of_its_tap_tests() -> None:
    described = EXAMPLE + '\n[[tool]]\nname = "plain"\ntool_material = "carbide"\ndiameter_mm = 20\nstick_out_mm = 60\n'
    program = described[described.index("[[program]]") :].split("\n\n")[0]
    named = re.sub(r'^(name|tool) = ".*"', lambda found: f'{found[1]} = "plain"', program, flags=re.MULTILINE)
    hashes = [parse_machine_file(text).settings_hash for text in (described, f"{described}\n{named}\n")]
    assert hashes[0] == hashes[1]
    shank = described.replace("stick_out_mm = 60", "stick_out_mm = 60\nshank_diameter_mm = 20")
    assert parse_machine_file(shank).settings_hash != hashes[0]
