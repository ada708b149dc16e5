"""Boards that run here, and a cable between board and host that does harm."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
from numpy.typing import NDArray
from scan_table import write_table

from acquisition import Channel, HammeredStructure, TapsFaults
from acquisition.emulation import EmulatorThread, quantise

ROOT = Path(__file__).parents[2]
SECONDS = 40.0
"""Length of the table of hits (s): about 88 hits."""
TOOLS = {"host": ("make", "cc"), "qemu": ("make", "arm-none-eabi-gcc", "qemu-system-arm")}
TABLE_ADDRESS = "0x21000000"


def _need(*tools: str) -> None:
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing and "CI" not in os.environ:
        pytest.skip(f"needs {', '.join(missing)}")


@pytest.fixture(scope="session")
def need() -> Callable[..., None]:
    """Skips where one of these tools is missing, but not where all must be tested."""
    return _need


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function that builds a target of firmware/Makefile once and returns its folder."""
    folder = tmp_path_factory.mktemp("firmware")

    @cache
    def make(target: str, *words: str) -> Path:
        build = folder / "-".join((target, *words))
        command = ["make", "-s", "-C", str(ROOT / "firmware"), target, f"BUILD={build}", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        return build / target

    return make


class Board:
    """A board that runs; `port` leads to its pseudo-terminal, also after replug()."""

    def __init__(self, command: list[str], port: Path) -> None:
        self._command, self.port = command, str(port)
        self.replug()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Cut the power at any moment."""
        self._process.kill()
        self._process.communicate(timeout=20)
        os.close(self._held)

    def replug(self) -> None:
        """Power again."""
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        named = re.search(r"/dev/\S+", line)
        assert named, line
        self._held = os.open(named[0], os.O_RDWR | os.O_NOCTTY)  # QEMU looks for who is there but once a second
        Path(self.port).unlink(missing_ok=True)
        Path(self.port).symlink_to(named[0])


class HarmfulCable(EmulatorThread):
    """A cable from a board to the host that loses, alters, cuts or doubles frames of samples."""

    def __init__(self, port: str, faults: TapsFaults) -> None:
        super().__init__(tcp=True)
        self._board, self._faults = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), faults
        self._rest, self._frames = b"", 0

    def serve_once(self) -> bool:
        if commands := self.wire.exchange(0.001):
            os.write(self._board, commands)
        if len(self.wire.pending) < 1 << 16:  # the board waits for the host
            try:
                *frames, self._rest = (self._rest + os.read(self._board, 65536)).split(b"\x00")
            except BlockingIOError:
                return True
            for frame in frames:
                self.wire.pending += self._passed(frame + b"\x00")
        return True

    def unplug(self) -> None:
        super().unplug()
        os.close(self._board)

    def _passed(self, frame: bytes) -> bytes:
        if frame[1:2] != b"\x10":  # DATA
            return frame
        self._frames += 1
        return self._faults.apply(frame, self._frames)


@pytest.fixture
def harmful_cable() -> type[HarmfulCable]:
    return HarmfulCable


@pytest.fixture
def codes(tapper: Callable[..., HammeredStructure], channels: tuple[Channel, Channel]) -> NDArray[np.int32]:
    """Return converter codes of hits without faults."""
    return quantise(tapper()(0, round(SECONDS * 25600)), channels)


@pytest.fixture
def switched_on(built: Callable[..., Path], tmp_path: Path) -> Callable[..., Board]:
    """Return a function that starts a board ("host", "qemu") that plays scans (2, n)."""

    def make(kind: str, codes: NDArray[np.int32], **how: Any) -> Board:
        _need(*TOOLS[kind])
        table = tmp_path / "table"
        write_table(table, codes, **how)
        if kind == "host":
            return Board([str(built("host") / "taps"), str(table)], tmp_path / "board")
        command = ["qemu-system-arm", "-M", "mps2-an385", "-kernel", str(built("mps2-an385") / "taps.elf")]
        command += ["-device", f"loader,file={table},addr={TABLE_ADDRESS},force-raw=on"]
        command += ["-display", "none", "-monitor", "none", "-serial", "pty"]
        return Board(command, tmp_path / "board")

    return make


@pytest.fixture
def events() -> list[tuple[int, str]]:
    """Return the events of a test board by scans since power-on: see firmware/boards/simulated.h."""
    return []


@pytest.fixture(params=list(TOOLS))
def board(
    request: pytest.FixtureRequest,
    switched_on: Callable[..., Board],
    codes: NDArray[np.int32],
    events: list[tuple[int, str]],
) -> Iterator[Board]:
    """Run a board that is tapped, as fast as the host reads."""
    with switched_on(request.param, codes, events=events) as running:
        yield running
