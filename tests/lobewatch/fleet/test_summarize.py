"""Standings that others make: several processes, or the workers of a Dask cluster."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster
from typer.testing import CliRunner

import lobewatch.fleet
from acquisition import DataError
from lobewatch.cli import app
from lobewatch.fleet import summarize
from lobewatch.fleet.fleet import Fleet, find_machines
from lobewatch.fleet.summarize import summarize_in_parallel
from lobewatch.measurement.share_work import Workers

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as made:
        yield made


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """Three machines that differ, one never tapped, one with a broken machine.toml; no standing of any."""
    shop.put("")
    for name, share in (("a", 1.0), ("b", 0.97), ("c", 0.88)):
        shop.tap_both(30 * (share < 1) + 30 * (share < 0.9), share)
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    type(shop)(tmp_path / "mills" / "new")
    type(shop)(tmp_path / "mills" / "broken")
    (tmp_path / "mills" / "broken" / "machine.toml").write_text("x", "utf-8")
    forget(tmp_path / "mills")
    return tmp_path / "mills"


def forget(mills: Path) -> None:
    for standing in mills.glob("*/standing.json"):
        standing.unlink()


def status(*arguments: object) -> list[dict[str, Any]]:
    told = CliRunner().invoke(app, ["status", *map(str, arguments), "--json"], catch_exceptions=False)
    assert told.exit_code == 1
    return [{**row, "days_left": None} for row in json.loads(told.stdout)["machines"]]


def test_several_processes_say_the_same(mills: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = status(mills)
    assert [row["key"] for row in alone] == ["broken", "c", "new", "b", "a"]
    forget(mills)
    monkeypatch.chdir(mills.parent)
    assert status("mills", "--jobs", "2") == json.loads(json.dumps(alone).replace(str(mills), "mills"))
    assert sorted(path.parent.name for path in mills.glob("*/standing.json")) == ["a", "b", "c", "new"]


def test_the_workers_of_a_cluster_say_the_same_of_a_path_that_counts_from_here(
    mills: Path, cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(mills.parent)
    alone = status("mills")
    forget(mills)
    assert status("mills", "--scheduler", cluster.scheduler_address) == alone


def test_what_others_have_made_is_not_made_again(mills: Path, shop: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    now, asked = shop.start + timedelta(days=90), list[str]()
    alone = Fleet(find_machines(mills)).assess_machines(now)
    forget(mills)
    made_here = lobewatch.fleet.summarize_folder

    def counted(path: Path, when: Any, *texts: Any) -> Any:
        asked.append(path.name)
        return made_here(path, when, *texts)

    monkeypatch.setattr("lobewatch.fleet.summarize_folder", counted)
    plant = Fleet(find_machines(mills))
    plant.make_missing_summaries(partial(summarize_in_parallel, workers=Workers(2)), now)
    forget(mills)  # as where they could not be written
    assert plant.assess_machines(now) == alone
    assert asked == ["broken"]


def test_statuses_that_are_there_go_to_nobody(mills: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = status(mills)
    (mills / "broken").rename(mills.parent / "elsewhere")
    monkeypatch.setattr(summarize, "summarize_in_parallel", lambda *_, **__: pytest.fail("somebody was asked"))
    found = CliRunner().invoke(app, ["status", str(mills), "--jobs", "2", "--json"], catch_exceptions=False)
    assert [row["light"] for row in json.loads(found.stdout)["machines"]] == [row["light"] for row in alone[1:]]


def test_folders_that_the_workers_do_not_see_are_inspected_here(
    mills: Path, cluster: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = status(mills)
    forget(mills)

    def hidden(*tasks: Any, **workers: Any) -> Any:
        mills.rename(tmp_path / "hidden")
        made = list(summarize_in_parallel(*tasks, **workers))
        (tmp_path / "hidden").rename(mills)
        assert made == []
        return made

    monkeypatch.setattr(summarize, "summarize_in_parallel", hidden)
    assert status(mills, "--scheduler", cluster.scheduler_address) == alone


def test_jobs_and_scheduler_at_once_and_a_scheduler_that_is_none_are_rejected(mills: Path) -> None:
    with pytest.raises(ValueError, match=r"Workers\.jobs 2.*Workers\.scheduler"):
        status(mills, "--jobs", "2", "--scheduler", "tcp://127.0.0.1:1")
    with pytest.raises(DataError, match=r"127\.0\.0\.1:1\b.*Dask"):
        status(mills, "--scheduler", "tcp://127.0.0.1:1")


def test_summaries_that_grow_old_together_are_renewed_a_few_at_a_look(
    mills: Path, shop: Shop, monkeypatch: pytest.MonkeyPatch
) -> None:
    (mills / "broken" / "machine.toml").unlink()
    now, asked = shop.start + timedelta(days=90), list[str]()
    plant = Fleet(find_machines(mills))
    before = {standing.key: standing.summary for standing in plant.assess_machines(now)}
    made_here = lobewatch.fleet.summarize_folder

    def counted(path: Path, when: Any, *texts: Any) -> Any:
        asked.append(path.name)
        return made_here(path, when, *texts)

    monkeypatch.setattr("lobewatch.fleet.summarize_folder", counted)
    monkeypatch.setattr("lobewatch.fleet.fleet.MAX_RENEWALS_PER_POLL", 1)
    for look in range(6):
        standings = plant.assess_machines(now + timedelta(days=8, seconds=look))
        assert {standing.key for standing in standings} == before.keys()
        assert len(asked) == min(look + 1, 4)
    assert sorted(asked) == ["a", "b", "c", "new"]
