"""Drivers of other packages that fail or hang: their package is named, and all others go on."""

from __future__ import annotations

import os
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acquisition import (
    DataError,
    DeviceError,
    DeviceIdentity,
    DeviceSettings,
    Driver,
    Remark,
    check_settings,
    probe_port,
    scan_ports,
)
from acquisition.devices.drivers import BUILT_IN_DRIVERS
from acquisition.devices.registry import convert_driver_errors
from acquisition.ports import SerialLink

WHO = DeviceIdentity("X", "1", "2")
METADATA = "Metadata-Version: 2.1\nName: bad-daq\nVersion: 1.0\n"


class UnprintableError(Exception):
    """Error whose text cannot be read."""

    def __str__(self) -> str:
        raise RuntimeError


class Stranger(BaseException):
    """Exception that is no Exception."""


@pytest.fixture
def port() -> Iterator[str]:
    """Open a pseudo-terminal that never answers."""
    ends = os.openpty()
    tty.setraw(ends[1])
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


@pytest.fixture
def bad_daq(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package bad-daq that brings the driver "bad"."""
    folder = tmp_path / "bad_daq-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(METADATA, "utf-8")
    (folder / "entry_points.txt").write_text("[lobewatch.drivers]\nbad = bad_daq:DRIVER\n", "utf-8")
    (tmp_path / "bad_daq.py").write_text("raise SystemExit('not today')\n", "utf-8")
    monkeypatch.syspath_prepend(tmp_path)


def driver(name: str, probe: Callable[[SerialLink], Any], **more: Any) -> Driver:
    return replace(BUILT_IN_DRIVERS[0], name=name, probe=probe, **more)


def raising(error: BaseException) -> Callable[..., Any]:
    def fail(*_: object) -> None:
        raise error

    return fail


def closing(link: SerialLink) -> None:
    link.close()
    raise KeyError("link")


def answering(link: SerialLink) -> DeviceIdentity:
    link.write(b"?")
    return WHO


@pytest.mark.parametrize(
    ("probe", "reason"),
    [
        (raising(KeyError("model")), "(KeyError: 'model')"),
        (raising(ValueError("two\nlines")), "(ValueError: two lines)"),
        (raising(SystemExit("enough")), "(SystemExit: enough)"),
        (raising(KeyboardInterrupt()), "(KeyboardInterrupt)"),
        (raising(Stranger()), "(test_failing_drivers.Stranger)"),
        (raising(UnprintableError()), "(test_failing_drivers.UnprintableError: <exception str() failed>)"),
        (closing, "(KeyError: 'link')"),
        (lambda _: "X 1 2", "str"),
        (lambda _: ("X", "1", "2"), "tuple"),
        (lambda _: DeviceIdentity, "type"),
        (lambda _: DeviceIdentity(None), "DeviceIdentity"),  # type: ignore[arg-type]
        (lambda _: DeviceIdentity("X", 17), "DeviceIdentity"),  # type: ignore[arg-type]
        (lambda _: DeviceIdentity("X", b"1"), "DeviceIdentity"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_a_probe_that_fails_or_talks_rubbish_is_named_and_the_next_is_asked(
    port: str, bad_daq: None, probe: Callable[[SerialLink], Any], reason: str
) -> None:
    remarks = list[Remark]()
    found = probe_port(port, [driver("bad", probe), driver("good", answering)], None, remarks)
    assert found is not None
    assert (found.driver, found.identity) == ("good", WHO)
    (remark,) = remarks
    assert (remark.code, remark.about) == ("package-not-loaded", "driver 'bad'")
    text = remark.text.replace("tests.acquisition.devices.", "")
    assert all(fact in text for fact in ("bad-daq", port, reason)), text


def test_a_probe_that_hangs_is_left_behind(port: str, bad_daq: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["acquisition.devices.registry"], "DRIVER_ANSWER_TIMEOUT", 0.2)
    end, remarks = threading.Event(), list[Remark]()
    found = probe_port(port, [driver("bad", lambda _: end.wait()), driver("good", lambda _: WHO)], None, remarks)
    end.set()
    assert found is not None
    assert found.driver == "good"
    (remark,) = remarks
    assert remark.code == "package-not-loaded"
    assert all(fact in remark.text for fact in ("bad-daq", "0.2 s", port)), remark.text


def test_a_probe_that_says_the_device_is_gone_ends_nothing(port: str) -> None:
    gone, good = driver("bad", raising(DeviceError("gone"))), driver("good", lambda _: WHO)
    remarks = list[Remark]()
    found = probe_port(port, [gone, good], None, remarks)
    assert (found is not None, remarks) == (True, [])


def test_ports_goes_on_without_a_package_that_ends_the_program_when_loaded(port: str, bad_daq: None) -> None:
    survey = scan_ports(port)
    assert [(seen.answer, seen.failure) for seen in survey.ports] == [(None, None)]
    (remark,) = survey.remarks
    assert remark.code == "package-not-loaded"
    assert all(fact in remark.text for fact in ("bad-daq", "SystemExit: not today")), remark.text


@pytest.mark.parametrize("error", [KeyError("x"), SystemExit(0), RuntimeError("a\nb")])
def test_settings_that_make_a_driver_fail_are_rejected_with_its_package(bad_daq: None, error: BaseException) -> None:
    with pytest.raises(DataError, match=rf"driver 'bad': .*bad-daq .*\[daq\] \({type(error).__name__}"):
        check_settings(driver("bad", lambda _: None, check=raising(error)), DeviceSettings())


@pytest.mark.parametrize("error", [KeyError("x"), SystemExit(0), RuntimeError("a\nb")])
def test_a_driver_that_fails_when_opened_is_a_device_that_is_not_there(bad_daq: None, error: BaseException) -> None:
    with (
        pytest.raises(DeviceError, match=rf"bad-daq .*opening COM1 .*{type(error).__name__}"),
        convert_driver_errors("bad", "opening COM1"),
    ):
        raise error
