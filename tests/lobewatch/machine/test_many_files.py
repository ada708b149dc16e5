"""Thousands of files in taps/ that are no tap tests: each is looked at a few times, however many there are."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from lobewatch.machine.verify_files import verify
from tests.lobewatch.conftest import Shop


def calls_of_verify(shop: Shop, monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Count opened files, listed folders and started programs."""
    counts = dict.fromkeys(("open", "scandir", "listdir"), 0)

    def counted(name: str, real: Any) -> Any:
        def call(*arguments: Any, **options: Any) -> Any:
            counts[name] += 1
            return real(*arguments, **options)

        return call

    def no_program(*_: object, **__: object) -> None:
        raise AssertionError("a program was started")

    with monkeypatch.context() as patch:
        for name in counts:
            patch.setattr(os, name, counted(name, getattr(os, name)))
        patch.setattr(subprocess, "run", no_program)
        verify(shop.path)
    return counts


def test_work_grows_with_the_number_of_files_not_with_its_square(shop: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    shop.tap(0, 1713.0)
    for number in range(2000):
        (shop.path / "taps" / f"empty{number}.h5").touch()
        if number == 199:
            few = calls_of_verify(shop, monkeypatch)
    many = calls_of_verify(shop, monkeypatch)
    assert {name: many[name] - few[name] for name in ("scandir", "listdir")} == {"scandir": 0, "listdir": 0}
    assert many["open"] - few["open"] <= 6 * 1800


def test_every_file_is_named(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    names = [f"taps/{number}.h5" for number in range(30)]
    for name in names:
        Path(shop.path / name).write_bytes(b"no HDF5")
    assert sorted(remark.about for remark in verify(shop.path).damage) == sorted(names)
    remarks = [remark for remark in shop.folder.contents().remarks if remark.code == "tap-unlisted"]
    assert len(remarks) == 21
    assert (remarks[-1].about, remarks[-1].text[:13]) == ("taps", "10 more files")
