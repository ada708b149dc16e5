"""Units of recorded files: known units are exact, missing units are not guessed."""

from __future__ import annotations

import pytest

from acquisition.files.contents.units import parse_unit

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("text", "quantity", "factor"),
    [
        ("m/N", "receptance", 1.0),
        ("um/N", "receptance", 1e-6),
        ("µm/N", "receptance", 1e-6),
        ("m/s/N", "mobility", 1.0),
        ("g/N", "accelerance", 9.80665),
        ("m/s^2/N", "accelerance", 1.0),
        ("(m/s²)/N", "accelerance", 1.0),
        ("(1/N)*(m/s²)", "accelerance", 1.0),
        ("m/(s^2*N)", "accelerance", 1.0),
        ("m s^-2 N^-1", "accelerance", 1.0),
        ("1/kg", "accelerance", 1.0),
        ("in/lbf", "receptance", 0.0254 / 4.4482216152605),
        ("G", "acceleration", 9.80665),
        ("m_s2", "acceleration", 1.0),
        ("ms-2", "acceleration", 1.0),
        ("m·s⁻²", "acceleration", 1.0),
        ("(ms^-1)/N", "mobility", 1.0),
        ("gal", "acceleration", 1e-2),
        ("daN", "force", 10.0),
        ("mN", "force", 1e-3),
        ("Newtons", "force", 1.0),
        ("rad/s", "frequency", 0.15915494309189535),
        ("kHz", "frequency", 1e3),
        ("ms", "time", 1e-3),
    ],
)
def test_units_in_any_spelling(text: str, quantity: str, factor: float) -> None:
    found = parse_unit(text)
    assert found is not None
    assert found.factor == pytest.approx(factor, rel=1e-14)
    assert str(found.quantity) == quantity


@pytest.mark.parametrize("text", ["", "1", "MN", "Volts", "dB", "m/", "((", "m)", "m^999999", "x/N", "N N N N/"])
def test_what_is_not_known_is_not_guessed(text: str) -> None:
    assert parse_unit(text) is None


def test_a_stiffness_is_no_frf() -> None:
    found = parse_unit("N/um")
    assert found is not None
    assert found.quantity == ""
