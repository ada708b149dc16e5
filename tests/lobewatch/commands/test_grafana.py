"""docs/grafana.json: each query of its panels is run against what lobewatch writes."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Any

import duckdb
import psycopg
import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.notify.prometheus import METRIC_FAMILIES

Server = Any
"""PostgreSQL of conftest.py."""
Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
BOARD = json.loads((Path(__file__).parents[3] / "docs" / "grafana.json").read_text("utf-8"))
COLUMNS = {
    "Natural frequency": ["time", "metric", "frequency_hz"],
    "Frequency relative to the first tap test of its series": ["time", "metric", "fall_percent"],
    "Damping ratio": ["time", "metric", "damping_ratio"],
    "Bearing stiffness": ["time", "metric", "bearing_stiffness_n_per_m"],
    "Tap tests per month": ["time", "tap_tests"],
    "Last tap test of each series": [
        *("folder", "machine", "tool", "direction", "last_tap", "frequency_hz"),
        *("damping_ratio", "stiffness_n_per_m", "remarks"),
    ],
    "Natural frequency (Parquet)": ["time", "metric", "frequency_hz"],
    "Tap tests per month (Parquet)": ["month", "tap_tests"],
}
"""Columns that each panel draws, by its title."""
PROMTOOL = shutil.which("promtool")


def panels(within: dict[str, Any] = BOARD) -> Iterator[dict[str, Any]]:
    for panel in within["panels"]:
        yield panel
        if "panels" in panel:
            yield from panels(panel)


def of(kind: str) -> dict[str, dict[str, Any]]:
    """List the panels of a kind of data source, by title."""
    return {panel["title"]: panel for panel in panels() if panel.get("datasource", {}).get("type") == kind}


POSTGRES, DUCKDB = of("grafana-postgresql-datasource"), of("motherduck-duckdb-datasource")


def filled(panel: dict[str, Any], **variables: str) -> str:
    """Return the query of a panel as Grafana sends it."""
    (target,) = panel["targets"]
    text = re.sub(r"\$__timeFilter\((\w+)\)", r"\1 BETWEEN '2026-01-20' AND '2026-12-31'", target["rawSql"])
    for name, value in {"machine:sqlstring": "'a','b'", **variables}.items():
        text = text.replace(f"${{{name}}}", value)
    assert "$" not in text
    return text


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    shop.put("")
    for days, share in ((0, 1.0), (30, 0.99), (60, 0.98)):
        shop.tap_both(days, share)
    for name in ("a", "b", "c"):
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    return tmp_path / "mills"


def export(*arguments: object) -> None:
    assert CliRunner().invoke(app, ["export", *map(str, arguments)], catch_exceptions=False).exit_code == 0


def check(panel: dict[str, Any], columns: list[str], rows: list[tuple[Any, ...]]) -> None:
    """Rows of the machines that are chosen, with the columns that the panel draws."""
    assert columns == COLUMNS[panel["title"]]
    assert rows
    for row in map(dict, (zip(columns, row, strict=True) for row in rows)):
        assert None not in row.values()
        assert all(isinstance(row[name], datetime) for name in ("time", "last_tap") if name in row)
        assert row.get("metric", row.get("folder", "a"))[0] in "ab"


@pytest.mark.parametrize("title", POSTGRES)
def test_each_query_of_postgresql_gives_what_its_panel_draws(
    server: Server, plant: str, mills: Path, title: str
) -> None:
    export(mills, "--to", server.address(plant))
    with psycopg.connect(server.address(plant)) as connection:
        cursor = connection.execute(filled(POSTGRES[title]))
        check(POSTGRES[title], [column.name for column in cursor.description or ()], rows := cursor.fetchall())
        if title.startswith("Frequency relative"):
            assert {round(row[2], 1) for row in rows} == {1.0, 2.0}
        (machine,) = (one for one in BOARD["templating"]["list"] if one["name"] == "machine")
        assert connection.execute(machine["query"]).fetchall() == [("a",), ("b",), ("c",)]


@pytest.mark.parametrize("title", DUCKDB)
def test_each_query_of_duckdb_gives_what_its_panel_draws(mills: Path, tmp_path: Path, title: str) -> None:
    export(mills, "--append", tmp_path / "fleet")
    with closing(duckdb.connect()) as base:
        answer = base.execute(filled(DUCKDB[title], parquet=str(tmp_path / "fleet")))
        columns = [column[0] for column in answer.description or ()]
        check(DUCKDB[title], columns, answer.fetchall())


def expressions() -> list[str]:
    return [target["expr"] for panel in of("prometheus").values() for target in panel["targets"]]


def test_prometheus_is_asked_for_what_lobewatch_tells() -> None:
    asked = {name for text in expressions() for name in re.findall(r"lobewatch_\w+", text)}
    assert len(asked) >= 6
    assert asked <= METRIC_FAMILIES.keys()


def test_promtool_takes_every_expression(tmp_path: Path) -> None:
    if PROMTOOL is None and "CI" not in os.environ:
        pytest.skip("promtool is not installed")
    rules = [{"record": f"panel:{i}", "expr": text} for i, text in enumerate(expressions())]
    (tmp_path / "rules.yml").write_text(json.dumps({"groups": [{"name": "panels", "rules": rules}]}), "utf-8")
    command = [str(PROMTOOL), "check", "rules", str(tmp_path / "rules.yml")]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr


def test_every_panel_has_a_source_that_the_board_asks_for_and_a_number_of_its_own() -> None:
    sources = {one["name"]: one["query"] for one in BOARD["templating"]["list"] if one["type"] == "datasource"}
    drawn = [panel for panel in panels() if panel["type"] != "row"]
    assert {panel["title"] for panel in drawn} == {*POSTGRES, *DUCKDB, *of("prometheus")}
    assert {*POSTGRES, *DUCKDB} == COLUMNS.keys()
    for panel in drawn:
        for source in (panel["datasource"], *(target["datasource"] for target in panel["targets"])):
            assert sources[source["uid"].strip("${}")] == source["type"]
    numbers = [panel["id"] for panel in panels()]
    assert len(numbers) == len(set(numbers))
