"""Serial ports: a late consumer, two programs, a pulled cable, a device that comes back."""

from __future__ import annotations

import errno
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import serial

from acquisition import DeviceError, find_usb_identity, find_usb_port
from acquisition.ports.serial_ports import SerialLink, explain_open_error

pty = pytest.importorskip("pty", reason="pseudo-terminals are needed")

HOLDER = """
import sys
from acquisition.ports import SerialLink
link = SerialLink(sys.argv[1])
print("open", flush=True)
input()
"""


class Cable:
    """Device end of a pseudo-terminal."""

    def __init__(self) -> None:
        import tty

        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._open = [self._slave, self.master]

    def pull(self) -> None:
        while self._open:
            os.close(self._open.pop())


@pytest.fixture
def cable() -> Iterator[Cable]:
    made = Cable()
    yield made
    made.pull()


@pytest.fixture
def link(cable: Cable) -> Iterator[SerialLink]:
    opened = SerialLink(cable.port)
    yield opened
    opened.close()


def read_until(link: SerialLink, n: int) -> bytes:
    data = b""
    while len(data) < n and (more := link.read(2.0)):
        data += more
    return data


@pytest.mark.quick
def test_what_comes_together_is_handed_over_together(cable: Cable, link: SerialLink) -> None:
    for _ in range(50):
        os.write(cable.master, bytes(2000))
        assert len(link.read(5.0)) == 2000


def test_a_sleeping_consumer_never_blocks_the_reader_and_loses_nothing_below_the_limit(
    cable: Cable, link: SerialLink
) -> None:
    sent = bytes(range(256)) * 4096
    writer = threading.Thread(target=write_all, args=(cable.master, sent))
    writer.start()
    writer.join(timeout=60)  # a pseudo-terminal holds some kB: that all was written, the reader has read
    assert not writer.is_alive()
    assert read_until(link, len(sent)) == sent
    assert link.overruns == 0


def test_beyond_the_limit_the_oldest_is_thrown_away_and_counted(
    cable: Cable, link: SerialLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.ports.serial_ports.MAX_UNREAD_BYTES", 100_000)
    sent = os.urandom(950_000)
    writer = threading.Thread(target=write_all, args=(cable.master, sent))
    writer.start()
    writer.join(timeout=60)
    assert not writer.is_alive()
    os.write(cable.master, b"the end")
    kept = b""
    while not kept.endswith(b"the end"):
        kept += link.read(2.0)
    assert (sent + b"the end").endswith(kept)
    assert len(kept) <= 100_000
    assert 9 <= link.overruns <= 10


def write_all(handle: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(handle, view[:4096]) :]


def test_two_programs_on_one_port(cable: Cable) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, cable.port], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"open\n"
        with pytest.raises(DeviceError, match="fuser"):
            SerialLink(cable.port)
        other.communicate(b"\n")
    SerialLink(cable.port).close()


@pytest.mark.parametrize("state", ["idle", "streaming", "writing"])
@pytest.mark.quick
def test_a_pulled_cable_is_one_error_with_its_cure(state: str, cable: Cable, link: SerialLink) -> None:
    if state == "streaming":
        write_all(cable.master, b"some bytes")
        assert read_until(link, 10) == b"some bytes"
    use = (lambda: link.write(b"?")) if state == "writing" else (lambda: link.read(5.0))
    cable.pull()
    with pytest.raises(DeviceError, match="unplugged"):
        use()
    link.close()
    link.close()


def test_what_came_before_the_cable_was_pulled_is_still_handed_over(cable: Cable, link: SerialLink) -> None:
    write_all(cable.master, b"last words")
    threading.Event().wait(0.3)  # the reader takes them up
    cable.pull()
    assert read_until(link, 10) == b"last words"
    with pytest.raises(DeviceError, match="unplugged"):
        link.read(5.0)


def test_a_device_that_takes_no_bytes_is_not_called_unplugged(
    link: SerialLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise serial.SerialTimeoutException("Write timeout")

    monkeypatch.setattr("serial.Serial.write", full)
    with pytest.raises(DeviceError, match="accept commands"):
        link.write(b"?")


@pytest.mark.parametrize(
    ("error", "cure"),
    [
        (OSError(errno.EBUSY, "Device or resource busy"), "fuser -v /dev/ttyACM0"),
        (PermissionError(errno.EACCES, "Permission denied"), "sudo usermod -aG dialout"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory"), "No such file .*acquisition.scan_ports"),
        (pytest.importorskip("termios").error(5, "Input/output error"), "Input/output error"),
    ],
    ids=["busy", "forbidden", "missing", "gone while opening"],
)
def test_a_port_that_cannot_be_opened_says_why(error: Exception, cure: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("serial.Serial", refuse)
    with pytest.raises(DeviceError, match=cure):
        SerialLink("/dev/ttyACM0")


def test_a_host_without_an_address_is_reported_in_the_words_of_the_system() -> None:
    error = socket.gaierror(-2, "Name or service not known")
    assert "(" + str(error) + ")" in explain_open_error("socket://daq.invalid:5", error).text


def test_a_device_is_found_wherever_it_is_plugged_in(monkeypatch: pytest.MonkeyPatch) -> None:
    modem = SimpleNamespace(device="/dev/ttyS0", vid=None, serial_number=None)
    other = SimpleNamespace(device="/dev/ttyACM0", vid=0x0683, serial_number="5C2A")
    ours = SimpleNamespace(device="/dev/ttyACM1", vid=0x0683, serial_number="5C2B")
    ports = [modem, other, ours]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda **_: ports)
    identity = find_usb_identity("/dev/ttyACM1")
    assert identity == (0x0683, "5C2B")
    ports.remove(ours)
    assert find_usb_port(*identity) is None
    ports.append(SimpleNamespace(device="/dev/ttyACM4", vid=0x0683, serial_number="5c2b"))
    assert find_usb_port(*identity) == "/dev/ttyACM4"
    ports.append(SimpleNamespace(device="/dev/ttyACM5", vid=0x0683, serial_number=None))
    assert find_usb_identity("/dev/ttyACM5") is None  # any other of its kind would be taken for it
    assert find_usb_identity("/dev/ttyS0") is find_usb_identity("/dev/pts/3") is None
