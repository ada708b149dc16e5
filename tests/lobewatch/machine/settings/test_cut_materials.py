"""The material of a cut: of one's own, published, by any of its names."""

from __future__ import annotations

import numpy as np
import pytest

from lobewatch.machine.settings.machine_file import parse_machine_file

pytestmark = pytest.mark.quick

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
    machine = parse_machine_file(EXAMPLE)
    assert machine.reference_cut is not None
    cut = machine.build_cut(machine.reference_cut)
    assert (cut.tangential, cut.radial, cut.immersion) == (800e6, 200e6, 0.5)
    assert cut.helix_lag == pytest.approx(2 * np.tan(np.radians(30)) / 0.01)
    steel = parse_machine_file(EXAMPLE.replace('material = "ours"', 'material = "Steel (textbook)"'))
    assert steel.reference_cut is not None
    assert steel.build_cut(steel.reference_cut).tangential == pytest.approx(2173.3e6)


@pytest.mark.parametrize("name", ["42CrMo4", "42crmo4", "1.7225", "AISI 4140", "aisi4140", " UNS G41400"])
def test_a_material_goes_by_any_of_its_names(name: str) -> None:
    machine = parse_machine_file(EXAMPLE.replace('material = "ours"', f'material = "{name}"'))
    assert machine.reference_cut is not None
    known = machine.coefficients(machine.reference_cut)
    assert (known.material, known.iso_group) == ("42CrMo4", "P")
    assert machine.build_cut(machine.reference_cut).tangential == pytest.approx(2726e6, rel=1e-3)


def test_a_material_of_ones_own_comes_before_a_published_one() -> None:
    for name in ("C45", "c 45"):
        text = EXAMPLE.replace('name = "ours"', 'name = "C45"').replace('material = "ours"', f'material = "{name}"')
        machine = parse_machine_file(text)
        assert machine.reference_cut is not None
        assert machine.coefficients(machine.reference_cut).tangential == 800e6


@pytest.mark.parametrize(
    ("old", "new", "facts"),
    [
        ('material = "ours"', 'material = "our"', "'our'.* 'ours'"),
        ('material = "ours"', "", "material, or both tangential_n_per_mm2 and radial_n_per_mm2"),
        (
            'material = "ours"',
            'material = "ours"\nradial_n_per_mm2 = 1',
            "material, or both tangential_n_per_mm2 and radial_n_per_mm2",
        ),
        (
            'material = "ours"',
            "tangential_n_per_mm2 = 1",
            "material, or both tangential_n_per_mm2 and radial_n_per_mm2",
        ),
        ('material = "ours"', 'material = "42CrMo5"', "'42CrMo5'.* '42CrMo4'.*lobes.materials_by_name"),
        ('material = "ours"', 'material = "AISI 4141"', "'AISI 4141'.* 'AISI 4140'"),
        ("tangential_n_per_mm2 = 800\n", "", "tangential_n_per_mm2 and radial_n_per_mm2, or specific"),
        (
            "radial_n_per_mm2 = 200",
            "radial_n_per_mm2 = 200\nforce_angle_deg = 60",
            "tangential_n_per_mm2 and radial_n_per_mm2, or specific",
        ),
        ("helix_deg = 30", "helix_deg = 90", "helix_deg"),
        ("teeth = 2", "teeth = 2\nfeed_per_tooth_mm = 0", "feed_per_tooth_mm"),
        ("[reference_cut]", "[drive]\npower_kw = 0\n[reference_cut]", "drive power_kw"),
    ],
)
def test_bad_materials_are_reported_with_their_place(old: str, new: str, facts: str) -> None:
    with pytest.raises(ValueError, match=facts):
        parse_machine_file(EXAMPLE.replace(old, new))
