"""`lobewatch materials`: what machine.toml may name."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from typing import Any

import pytest

from lobewatch.cli import main

Materials = Callable[..., tuple[Any, str, str]]


@pytest.fixture
def materials(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Materials:
    """Exit code, output and errors of `lobewatch materials`."""

    def command(*words: str) -> tuple[Any, str, str]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", "materials", *words])
        with pytest.raises(SystemExit) as end:
            main()
        return end.value.code, *capsys.readouterr()

    return command


@pytest.mark.quick
def test_a_material_is_shown_with_range_other_names_and_sources(materials: Materials) -> None:
    code, out, _ = materials("1.0503")
    assert code == 0
    table = out.splitlines()[:3]
    assert table[2].split()[:7] == ["C45", "P", "2237", "1667..2904", "0.27", "0.13..0.54", "56"]
    assert max(map(len, table)) <= 80
    assert "AISI" in out
    assert re.search("2220.*0.14.*Kienzle & Victor 1957", out)
    assert "0.1 mm" in out


def test_all_are_listed_without_their_sources(materials: Materials) -> None:
    code, out, _ = materials()
    assert code == 0
    assert re.search(r"^Al 7075 \(HSS; dry\) +N +951 +600..1319 +0.28$", out, re.MULTILINE)
    assert max(len(line) for line in out.splitlines() if "  " in line) <= 80
    assert "Kienzle" not in out
    assert "lobewatch materials NAME" in out
    assert "--json" in out


@pytest.mark.quick
def test_rows_of_json_carry_units_ranges_and_a_source(materials: Materials) -> None:
    code, out, _ = materials("--json")
    rows = {row["name"]: row for row in json.loads(out)["materials"]}
    assert code == 0
    assert len(rows) == 66
    steel = rows["C45"]
    assert (steel["iso_group"], "AISI 1045" in steel["equivalents"]) == ("P", True)
    assert steel["kt_n_per_mm2"] == pytest.approx(2237, abs=1)
    assert steel["kt_range_n_per_mm2"] == pytest.approx([1667, 2904], abs=1)
    assert steel["kr_n_per_mm2"] == pytest.approx(604, abs=1)
    assert steel["kr_over_kt_range"] == [0.13, 0.54]
    assert steel["kte_n_per_mm"] == pytest.approx(56.3, abs=0.1)
    assert steel["chip_thickness_mm"] == pytest.approx(0.1)
    assert steel["specific_forces"][2] | {"source": ""} == {"kc1_1_n_per_mm2": 2220, "mc": 0.14, "source": ""}
    assert rows["Steel (textbook)"]["kt_range_n_per_mm2"] is None
    assert all(row["source"] for row in rows.values())


def test_a_name_that_nothing_has_is_reported_with_the_nearest(materials: Materials) -> None:
    code, out, err = materials("42CrMo5", "--json")
    assert (code, out) == (2, "")
    assert re.search("'42CrMo5'.*'42CrMo4'", err)


@pytest.mark.quick
def test_quantiles_and_correlation_of_a_listed_material_are_shown(materials: Materials) -> None:
    """Upper 5 % of TiAl6V4 by hand: all of it in the last fifth of the largest of four sources of equal weight."""
    titanium = json.loads(materials("TiAl6V4", "--json")[1])["materials"][0]["joint"]
    low, high = (0.78 * 2110 * chip**-0.22 for chip in (0.2, 0.05))
    assert titanium["probabilities"] == [0.05, 0.5, 0.95]
    assert titanium["kt_n_per_mm2"][2] == pytest.approx(high - 4 * 0.05 * (high - low))
    assert titanium["kr_over_kt"] == pytest.approx([0.154, 0.28, 0.532])
    assert titanium["rank_correlation"] == 0.4
    assert json.loads(materials("Steel (textbook)", "--json")[1])["materials"][0]["joint"] is None
