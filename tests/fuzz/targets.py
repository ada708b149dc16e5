"""Parts of lobewatch that read foreign bytes. Each check raises nothing but AssertionError, for any bytes."""

from __future__ import annotations

import atexit
import hashlib
import json
import shutil
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import acquisition
from acquisition import Channel, Device, DeviceError, SimulatedSource, TapsSource
from acquisition.files.hdf5_file import append_checksum
from acquisition.taps import protocol
from acquisition.taps.bridge import TapsBridge
from acquisition.taps.protocol import Frame, MessageType, encode_data, encode_frame
from acquisition.taps.source import probe_taps
from acquisition.text_boards.decoders import FrameFormat, LineDecoder, ScanCounter, SimpleFrameDecoder
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.journal.journal import Journal, compute_crc, make_entry
from tests.fuzz.mutations import edited, edited_object
from tests.lobewatch.commands.invoke import invoke

ROOT = Path(__file__).parents[2]
MACHINE = ROOT / "tests" / "data" / "version_1" / "machine"
CORPUS = Path(__file__).parent / "corpus"
SENSORS = (Channel("force", 1.0, 1.0), Channel("acceleration", 1.0, 1.0))
RATE = 25600.0


@dataclass(frozen=True)
class Target:
    """Reader of foreign bytes."""

    name: str
    """Name of its folder of kept inputs."""
    inputs: Callable[[], st.SearchStrategy[bytes]]
    """Function that returns a strategy of nearly right inputs."""
    check: Callable[[bytes, Path], None]
    """Check of one input in an empty folder."""
    examples: int
    """Number of inputs in a short run, below ten seconds of CPU."""


def find_error(read: Callable[..., object], *arguments: object) -> str | None:
    """Return the sentence that a reader ends with, None if it ends well. Any other end is a fault."""
    try:
        read(*arguments)
    except (ValueError, OSError) as error:
        return str(error)
    return None


def run_command(*words: str) -> dict[str, Any]:
    """Return the JSON of a command, or {"error": sentence}. Any other end is a fault."""
    try:
        result = invoke([*words, "--json"])
    except (ValueError, OSError) as error:
        return {"error": str(error)}
    assert result.exit_code in (0, 1, 2), result.output
    answer = json.loads(result.stdout) if result.stdout.strip() else {"error": result.stderr}
    return answer if isinstance(answer, dict) else {"answer": answer}


# machine.toml


def check_machine_toml(content: bytes, folder: Path) -> None:
    """Any machine.toml is a machine, or one error that names the file."""
    (folder / "machine.toml").write_bytes(content)
    error = find_error(lambda: MachineFolder(folder).machine)
    answer = run_command("status", str(folder))
    if error is not None:
        assert "machine.toml" in error
        assert "machine.toml" in json.dumps(answer)


# journal.jsonl


def encode_journal(entries: list[Any]) -> bytes:
    """Encode entries as a chain of lines with the right digests."""
    lines, last = list[bytes](), b""
    for number, entry in enumerate(entries, 1):
        fields = {**entry, "number": number, "previous": hashlib.sha256(last).hexdigest() if last else ""}
        last = json.dumps(fields | {"crc": compute_crc(fields)}).encode()
        lines.append(last)
    return b"".join(line + b"\n" for line in lines)


@cache
def make_machine() -> Path:
    """Make a machine with two tap tests and lines of several kinds, once."""
    folder = Path(tempfile.mkdtemp(prefix="lobewatch-fuzz-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    make_machine_folder(folder / "mill", "surrogate_machine.toml")
    toml = folder / "mill" / "machine.toml"
    toml.write_text(
        toml.read_text(encoding="utf-8").partition("[[program]]")[0], encoding="utf-8"
    )  # verdicts take long
    taps = [str(path) for path in sorted((ROOT / "sim_data").glob("*.h5"))]
    assert invoke(["replay", str(folder / "mill"), *taps]).exit_code == 0
    first = min((folder / "mill" / "taps").iterdir()).stem
    MachineFolder(folder / "mill").journal.append(
        make_entry("event", id="e1", date="2026-01-17T09:00:00+00:00", text="bearing", new_baseline=True),
        make_entry("exclude", tap=first, reason="wrong tool"),
        make_entry("accept", tap=first, code="frequency-jump"),
        make_entry("modes", tap=first, add=[], remove=[3300.0]),
    )
    return folder / "mill"


@cache
def read_entries() -> list[Any]:
    """Return the entries of the machine, without digests."""
    entries = [json.loads(line) for line in (make_machine() / "journal.jsonl").read_bytes().splitlines()]
    return [{key: value for key, value in entry.items() if key not in ("crc", "previous")} for entry in entries]


def encode_objects(entries: list[Any]) -> bytes:
    """Encode the entries that are objects."""
    return encode_journal([entry for entry in entries if isinstance(entry, dict)])


def journals() -> st.SearchStrategy[bytes]:
    """Return a strategy of journals with wrong bytes, or with right digests and wrong entries."""
    entries = read_entries()
    return edited_object(entries).map(encode_objects) | edited([encode_journal(entries)])


def check_journal(content: bytes, folder: Path) -> None:
    """Lines of any journal count or are named, and a command answers or ends in one sentence."""
    shutil.copytree(make_machine(), folder, dirs_exist_ok=True)
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        (folder / name).write_bytes(content)
    reading = Journal(folder).read()
    lines = [line for line in content.split(b"\n") if line.strip()]
    verified = run_command("verify", str(folder))
    if len(reading.lines) < len(lines):
        assert reading.damage or reading.torn
        assert json.dumps(verified) != "{}"
    for words in (("status", str(folder)), ("history", str(folder)), ("event", str(folder), "seen")):
        run_command(*words)


# bridge


class EndlessDevice(SimulatedSource):
    """Device that starts again and again."""

    def __init__(self) -> None:
        super().__init__(lambda _, n: np.zeros((2, n)), SENSORS, RATE, 2**62)

    def stop(self) -> None: ...


@contextmanager
def serving_bridge() -> Iterator[TapsBridge]:
    """Serve a device on a bridge."""
    bridge = TapsBridge(EndlessDevice, lambda _: None)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    try:
        yield bridge
    finally:
        bridge.stop()
        thread.join(30.0)


@st.composite
def streams(draw: st.DrawFn) -> bytes:
    """Draw frames with right checksums and wrong bodies, followed by other bytes."""
    config = {"fs": RATE, "channels": [0, 1], "format": 0, "samples_per_frame": 512}
    info = protocol.build_info(EndlessDevice.identity, SENSORS, RATE, follows_clock=True) | {"serial": "1"}
    objects = edited_object(config) | edited_object(info)
    texts = objects.map(json.dumps).map(str.encode)
    bodies = texts | st.binary(max_size=40) | edited([encode_data(0, np.zeros((2, 4), np.int32)), bytes(8)])
    kinds = st.sampled_from([*MessageType, 0x77])
    frames = draw(st.lists(st.tuples(kinds, st.integers(0, 3), bodies, st.integers(0, 2)), max_size=6))
    sent = [encode_frame(Frame(kind, seq, body[:8000], session)) for kind, seq, body, session in frames]
    return b"".join(sent) + draw(edited([b"", bytes(50)]))


class FixedLink:
    """Link to a device that sends fixed bytes, a piece for each command, and is then unplugged."""

    port = "fuzz"
    overruns = 0

    def __init__(self, content: bytes) -> None:
        self._pieces = [content[i : i + 3000] for i in range(0, len(content), 3000)]

    def write(self, data: bytes) -> None: ...

    def read(self, _timeout: float) -> bytes:
        if not self._pieces:
            raise DeviceError("unplugged")
        return self._pieces.pop(0)

    def close(self) -> None: ...


def check_bridge(content: bytes, _folder: Path) -> None:
    """Any bytes of a host leave the bridge to the next host; any bytes of a device are blocks or one DeviceError."""
    with serving_bridge() as bridge:
        address, _, number = bridge.port.removeprefix("socket://").partition(":")
        with closing(socket.create_connection((address, int(number)), timeout=5.0)) as host, suppress(ConnectionError):
            host.sendall(content)
            host.shutdown(socket.SHUT_WR)
            while host.recv(1 << 20):
                pass
        with TapsSource(bridge.port) as source:
            assert source.channels == SENSORS
    with suppress(DeviceError):
        probe_taps(FixedLink(content))  # type: ignore[arg-type]
    with mock.patch("acquisition.taps.source.SerialLink", return_value=FixedLink(content * 6)), suppress(DeviceError):
        read_device(TapsSource("fuzz"))


def read_device(device: Device) -> None:
    """Read a device to its end."""
    with device:
        device.start()
        for block in device.blocks():
            assert block.codes.shape[0] == len(device.channels)
            assert block.codes.shape[1] > 0
            assert 0 <= block.lost_before < 2**53


# lines


def check_lines(content: bytes, _folder: Path) -> None:
    """Any bytes of a board are finite scans with a bounded loss, and scans after them are read."""
    forms = [FrameFormat(b"\xaa\xbb"), FrameFormat(b"\xaa\xbb", counter=True), FrameFormat(b"\xaa", checksum=False)]
    decoders: list[LineDecoder | SimpleFrameDecoder] = [LineDecoder(), *map(SimpleFrameDecoder, forms)]
    for decoder in decoders:
        counter = ScanCounter()
        for piece in (content[:1000], content[1000:], content):
            for printed in decoder.feed(piece):
                for scans, lost in counter.split_runs(printed):
                    assert np.isfinite(scans).all()
                    assert 0 <= lost < 2**32 + len(content)
    lines = LineDecoder()
    list(lines.feed(content))
    list(lines.feed(b"\n"))
    width = lines._columns or 3  # noqa: SLF001
    (rows,) = lines.feed(b"\n" + b",".join([b"1"] * width) + b"\n")
    assert rows.rows.tolist() == [[1.0] * width]


# tap files


def check_tap(content: bytes, folder: Path) -> None:
    """Any file in the place of a tap file is read, or is one error that names it."""
    path = folder / "tap.h5"
    path.write_bytes(append_checksum(content))  # a wrong checksum would end the check
    assert "tap.h5" in (find_error(acquisition.inspect_file, path) or "tap.h5")


TOML_SEEDS = [(ROOT / "sim_data" / name).read_bytes() for name in ("surrogate_machine.toml", "new_machine.toml")]
LINE_SEEDS = [
    b"".join(b"%d,%.4f,%.4f\r\n" % (i, 0.1 * i, -0.2 * i) for i in range(60)),
    b"".join(b"%d;%d\n" % (i, 4095 - i) for i in range(60)),
    b"".join(b"\xaa\xbb" + bytes([i, 0, i, 1, (2 * i + 1) & 0xFF]) for i in range(60)),
    b"".join(b"\xaa" + bytes([i, 0, i, 1]) for i in range(60)),
]
TAP_SEEDS = [path.read_bytes() for path in sorted((MACHINE / "taps").iterdir())]
TARGETS = (
    Target("machine_toml", partial(edited, TOML_SEEDS), check_machine_toml, 120),
    Target("journal", journals, check_journal, 70),
    Target("bridge", streams, check_bridge, 250),
    Target("lines", partial(edited, LINE_SEEDS), check_lines, 500),
    Target("tap", partial(edited, TAP_SEEDS), check_tap, 200),
)
"""All readers."""
