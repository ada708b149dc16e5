"""Compare machine folders, the output of commands and all exports with those that are kept, byte by byte.

The commands and their kept answers are in tests/data/unchanged. A failure names the folder with the new answers.
After an intended change, look at them and copy them to tests/data/unchanged.
"""

from __future__ import annotations

import atexit
import contextlib
import difflib
import gc
import gzip
import hashlib
import importlib
import io
import itertools
import json
import pkgutil
import platform
import re
import secrets
import shlex
import shutil
import signal
import sqlite3
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime, tzinfo
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import duckdb
import h5py
import msgspec
import numpy as np
import pytest
import scipy.io

from lobewatch.cli import main
from tests.lobewatch.notify.fake_broker import PUBLISH, FakeBroker, obey

KEPT = Path(__file__).parents[1] / "data" / "unchanged"
CHAPTERS = tuple(sorted(path.stem for path in (KEPT / "commands").glob("*.txt")))
PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TOLERANCE = 3e-5
"""Relative difference of numbers that another processor causes at most."""
FLOOR = 1e-12
"""Absolute difference of numbers that counts as none."""
MASKS = (
    (re.compile(r'("mark": ?)\[[^]]*\]'), r"\1[]"),
    (re.compile(r'("software": ?"(?:lobewatch )?)[^"]*'), r"\1"),
    (re.compile(r"(by lobewatch )[0-9.]+\d"), r"\g<1>0"),
    (re.compile(r'("worst_feed_deg": ?)[0-9.]+'), r"\g<1>0"),
    (re.compile(r'("crc": ?")\w+'), r"\1"),
    (re.compile(r'("residual_hz": ?)-?[0-9.]+e-(?:09|[1-9]\d)'), r"\g<1>0"),
    (re.compile(r"^\d+ of \d+ programs are checked.*\n|^.*: \d+ of \d+ tap tests\n", re.MULTILINE), ""),
    (re.compile(r"numpy \S+, scipy \S+ on \w+"), "numpy"),
    (re.compile(r'("kind": "mass-check", "id": "m1", "date": ")[^"]*(".*?"time": ")[^"]*'), r"\1\2"),
)
"""File marks of this disk with their checksum, versions, progress lines, a feed direction and a residual that rounding
decides, and the time at which an emulator starts in another process."""
DIGESTS = re.compile(r'(^sha256 |"(?:sha256|previous|crc)": ?"?)[0-9a-f]+', re.MULTILINE)
"""Checksums, which follow from numbers that may differ on another processor."""


class AnyTime(type):
    """The kind of a class that is equal to that of plain times, as the declarations of options are read."""

    def __eq__(cls, other: object) -> bool:
        """Tell whether it is one of the two."""
        return other is datetime or other is cls

    __hash__ = type.__hash__


class Clock(datetime, metaclass=AnyTime):
    """A clock that a chapter sets; the times that it returns are plain ones."""

    set_to = datetime(2026, 1, 1, tzinfo=UTC)

    def __new__(cls, *parts: Any, **named: Any) -> Any:
        """Return a plain time."""
        return datetime(*parts, **named)  # noqa: DTZ001

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Any:
        """Return the time of the chapter."""
        return cls.set_to.astimezone(tz) if tz else cls.set_to.replace(tzinfo=None)


def is_own(module: str) -> bool:
    """Tell whether a module belongs to this project."""
    return module.partition(".")[0] in PACKAGES


def import_all() -> list[ModuleType]:
    """Import every module of the project and resolve the fields of all records, which a patched clock would hide."""
    for package in PACKAGES:
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            with contextlib.suppress(ImportError):  # libraries of devices that are not installed
                importlib.import_module(module.name)
    modules = [module for name, module in sys.modules.items() if is_own(name)]
    for record in [value for module in modules for value in vars(module).values()]:
        if isinstance(record, type) and issubclass(record, msgspec.Struct) and is_own(record.__module__):
            msgspec.json.Decoder(record)
    return modules


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Make a folder with the recordings and the machine folder; fix clock, identities and environment."""
    for module in import_all():
        if getattr(module, "datetime", None) is datetime:
            monkeypatch.setattr(module, "datetime", Clock)
    count, token = itertools.count(), secrets.token_hex
    monkeypatch.setattr(secrets, "token_hex", lambda size: f"{next(count):04x}" if size == 2 else token(size))
    monkeypatch.setattr(atexit, "register", lambda function, *_, **__: function)
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None, raising=False)  # named in "Usage: lobewatch"
    monkeypatch.setattr(gc, "set_threshold", lambda *_: None)
    for name, value in {"TZ": "UTC", "COLUMNS": "100", "LOGNAME": "kim", "USER": "kim"}.items():
        monkeypatch.setenv(name, value)
    time.tzset()
    shutil.copytree(KEPT / "recordings", tmp_path / "run")
    shutil.copytree(KEPT / "machine", tmp_path / "run" / "mill")
    monkeypatch.chdir(tmp_path / "run")
    handler = signal.getsignal(signal.SIGTERM)
    yield tmp_path
    signal.signal(signal.SIGTERM, handler)
    monkeypatch.undo()
    time.tzset()


def run(words: list[str], monkeypatch: pytest.MonkeyPatch) -> tuple[int, str, str]:
    """Run a command; return its exit code, stdout and stderr."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="") for _ in range(2))
    with monkeypatch.context() as patch:
        for name, value in {"argv": words, "stdout": out, "stderr": err, "stdin": io.StringIO()}.items():
            patch.setattr(sys, name, value)
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        texts = []
        for stream in (out, err):
            stream.flush()
            texts.append(stream.buffer.getvalue().decode())
    return code, texts[0], texts[1]


class Chapter:
    """A list of commands with what they print and write."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self._patch, self._stack = folder, monkeypatch, contextlib.ExitStack()
        self._meant: dict[str, str] = {}
        self._broker: FakeBroker | None = None

    def play(self, name: str) -> dict[str, str]:
        """Return the answer to each command by its line."""
        answers: dict[str, str] = {}
        with self._stack:
            for number, line in enumerate((KEPT / "commands" / f"{name}.txt").read_text("utf-8").splitlines(), 1):
                word, *rest = shlex.split(line, comments=True) or [""]
                if word:
                    answer = getattr(self, f"do_{word}")(*rest)
                    if answer is not None:
                        answers[f"{number:03d} {line}"] = self._masked(answer)
        return answers

    def _masked(self, text: str) -> str:
        for word, meant in [*self._meant.items(), ("FOLDER", str(self.folder))]:
            text = text.replace(meant, word)
        for pattern, masked in MASKS:
            text = pattern.sub(masked, text)
        text = text.removesuffix("err:\n")  # only progress lines, which a fast computer does not show
        return text if text.endswith("\n") else f"{text}\n"

    def do_at(self, moment: str) -> None:
        Clock.set_to = datetime.fromisoformat(moment).replace(tzinfo=UTC)

    def do_copy(self, source: str, target: str) -> None:
        Path(target).parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if Path(source).is_dir() else shutil.copy)(source, target)

    def do_remove(self, path: str) -> None:
        shutil.rmtree(path) if Path(path).is_dir() else Path(path).unlink()

    def do_write(self, path: str, text: str) -> None:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(text.replace("\\n", "\n"), "utf-8")

    def do_append(self, path: str, other: str) -> None:
        Path(path).write_bytes(Path(path).read_bytes() + Path(other).read_bytes())

    def do_edit(self, path: str, old: str, new: str) -> None:
        text, old, new = Path(path).read_text("utf-8"), old.replace("\\n", "\n"), new.replace("\\n", "\n")
        assert old in text
        Path(path).write_text(text.replace(old, self._replaced(new), 1), "utf-8")

    def do_broker(self) -> None:
        self._broker = self._stack.enter_context(FakeBroker(obey))
        self._meant["BROKER"] = self._broker.place

    def do_published(self) -> str:
        assert self._broker is not None
        messages = []
        for kind, content in self._broker.received:
            if kind == PUBLISH:
                topic_end = 2 + int.from_bytes(content[:2])
                properties = content[topic_end + 2]
                payload = content[topic_end + 3 + properties :].decode()
                messages.append(f"{content[2:topic_end].decode()} {payload}")
        self._broker.received.clear()
        return "\n".join(messages)

    def do_emulate(self, *words: str) -> None:
        program = "import sys; sys.argv[0] = 'lobewatch'; from lobewatch.cli import main; main()"
        command = [sys.executable, "-c", program, "emulate", *words, "--tcp", "--json"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self._stack.callback(process.wait)
        self._stack.callback(process.terminate)
        assert process.stdout is not None
        self._stack.enter_context(process.stdout)
        self._meant["PORT"] = json.loads(process.stdout.readline())["port"]

    def do_lobewatch(self, *words: str) -> str:
        code, out, err = run(["lobewatch", *map(self._replaced, words)], self._patch)
        return f"exit code {code}\n" + "".join(
            f"{name}:\n{text}" for name, text in (("out", out), ("err", err)) if text
        )

    def do_quiet(self, *words: str) -> str:
        """Run without progress output, which depends on the speed of the computer."""
        code, out, err = run([*map(self._replaced, words)], self._patch)
        return "\n".join([f"exit code {code}", out, *re.findall("^error: .*", err, re.MULTILINE)])

    def do_shape(self, *words: str) -> str:
        """Only what kinds of values are in the JSON that a command prints, of commands that ask this computer."""
        code, out, _ = run([*map(self._replaced, words)], self._patch)
        return f"exit code {code}\n{shape_of(json.loads(out))}"

    def do_show(self, path: str) -> str:
        return describe(Path(path)) if Path(path).exists() else "no such file"

    def do_shape_of(self, path: str) -> str:
        return shape_of(json.loads(Path(path).read_bytes()))

    def do_tree(self, path: str) -> str:
        files = sorted(file for file in Path(path).rglob("*") if file.is_file() and file.suffix != ".lock")
        return "\n".join(f"{file}\n{describe(file)}" for file in files)

    def do_contents(self, path: str) -> str:
        """Without checksums, of files that hold a port of this computer."""
        return DIGESTS.sub(r"\1", self.do_tree(path))

    def do_names(self, path: str) -> str:
        return "\n".join(sorted(str(file) for file in Path(path).rglob("*")))

    def _replaced(self, word: str) -> str:
        for name, meant in self._meant.items():
            word = word.replace(name, meant)
        return word


def shape_of(value: object) -> str:
    """Return JSON with the kind of each value in its place."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {shape_of(part)}" for name, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(sorted({shape_of(part) for part in value})) + "]"
    return "number" if isinstance(value, int | float) and not isinstance(value, bool) else type(value).__name__


def describe(path: Path) -> str:
    """Return the content of a file as text, with its checksum where the bytes are reproducible."""
    content = path.read_bytes()
    lines = [*DESCRIBERS.get(path.suffix, describe_text)(path)]
    digest = [] if path.suffix in UNSTEADY else [f"sha256 {hashlib.sha256(content).hexdigest()}"]
    return "\n".join([*digest, *lines])


def describe_text(path: Path) -> Iterator[str]:
    yield path.read_bytes().decode()


def describe_packed(path: Path) -> Iterator[str]:
    yield gzip.decompress(path.read_bytes()).decode()


def describe_hdf5(path: Path) -> Iterator[str]:
    with h5py.File(path) as file:
        parts: list[tuple[str, Any]] = [("/", file)]
        file.visititems(lambda name, part: parts.append((name, part)))
        for name, part in parts:
            yield f"{name} {describe_values(part[()]) if isinstance(part, h5py.Dataset) else 'group'}"
            if isinstance(part, h5py.Dataset):
                yield f"  chunks {part.chunks} {part.compression} {part.compression_opts} shuffle {part.shuffle}"
            for key, value in sorted(part.attrs.items()):
                shown = f'"software": "{value}"' if key == "software" else describe_values(value)
                yield f"  @{key} {shown}"


def describe_values(value: object) -> str:
    """Return kind, shape, first values and sums of an array."""
    array = np.asarray(value)
    if array.dtype.kind in "OSU":
        return f"{array.dtype.kind}{array.shape} {array.ravel()[:200].tolist()}"
    if array.dtype.names:
        return f"{array.dtype} {array.shape} {array.ravel()[:5].tolist()}"
    flat = array.ravel()
    if flat.dtype.kind == "c":
        flat = np.concatenate([flat.real, flat.imag])
    shown = " ".join(f"{number:.9g}" for number in flat[:8].tolist())
    known = flat[np.isfinite(flat)].astype(float)
    sums = f"{np.sum(np.abs(known)):.9g} {np.sum(known**2):.9g}" if known.size else "none"
    return f"{array.dtype} {array.shape} [{shown}] sums {sums}"


def describe_nothing(_: Path) -> Iterator[str]:
    yield "not compared"


def describe_matlab(path: Path) -> Iterator[str]:
    for name, value in scipy.io.loadmat(path, struct_as_record=True, mat_dtype=False).items():
        if not name.startswith("__"):
            yield f"{name} {describe_values(value)}"


def describe_sqlite(path: Path) -> Iterator[str]:
    with contextlib.closing(sqlite3.connect(path)) as base:
        yield from base.iterdump()


def describe_parquet(path: Path) -> Iterator[str]:
    with duckdb.connect() as base:
        for line in base.execute("DESCRIBE SELECT * FROM read_parquet(?)", [str(path)]).fetchall():
            yield str(line)
        for line in base.execute("SELECT * FROM read_parquet(?)", [str(path)]).fetchall():
            yield repr(line)


def describe_rows(path: Path) -> Iterator[str]:
    content = path.read_bytes()
    at = content.index(b"\n") + 1
    yield content[: at - 1].decode()
    is_head = True
    while at < len(content):
        length, _ = struct.unpack_from("<II", content, at)
        row = content[at + 8 : at + 8 + length]
        at += 8 + length
        yield row.partition(b" ")[0].decode() if is_head else json.dumps(msgspec.msgpack.decode(row))
        is_head = False


DESCRIBERS: dict[str, Callable[[Path], Iterable[str]]] = {
    ".h5": describe_hdf5,
    ".mat": describe_matlab,
    ".sqlite": describe_sqlite,
    ".parquet": describe_parquet,
    ".rows": describe_rows,
    ".gz": describe_packed,
    ".html": describe_nothing,
}
UNSTEADY = (".mat", ".sqlite", ".parquet", ".rows", ".gz", ".json", ".html")
"""Endings of files whose bytes depend on versions, times or places beside their content."""


def software() -> dict[str, str]:
    """Return the versions that bytes on the disk depend on."""
    names = ("lobewatch", "numpy", "scipy", "h5py")
    return {name: version(name) for name in names} | {"hdf5": h5py.version.hdf5_version, "cpu": platform.machine()}


def is_same(new: str, kept: str) -> bool:
    """Tell whether two answers agree: byte by byte, or in all but the last digits of numbers."""
    if new == kept:
        return True
    new, kept = (DIGESTS.sub(r"\1", text) for text in (new, kept))
    if new == kept:  # only checksums differ
        return bool(software() != json.loads((KEPT / "software.json").read_text("utf-8")))
    if NUMBER.split(new) != NUMBER.split(kept):
        return False
    numbers = ([*map(float, NUMBER.findall(text))] for text in (new, kept))
    return all(abs(a - b) <= max(FLOOR, TOLERANCE * max(abs(a), abs(b))) for a, b in zip(*numbers, strict=True))


def as_text(answers: dict[str, str]) -> str:
    """Return the answers as they are kept."""
    return "".join(f"$ {line}\n{answer}\n" for line, answer in answers.items())


def parse_answers(text: str) -> dict[str, str]:
    """Return the kept answers by the lines of their commands."""
    parts = re.split(r"^\$ (\d{3} .*)\n", text, flags=re.MULTILINE)[1:]
    return {line: answer.removesuffix("\n") for line, answer in zip(parts[::2], parts[1::2], strict=True)}


@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", CHAPTERS)
def test_every_answer_and_file_is_the_kept_one(name: str, shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the commands of a chapter, then compare what they print and write."""
    answers = Chapter(shop, monkeypatch).play(name)
    new, path = shop / "answers" / f"{name}.txt", KEPT / "answers" / f"{name}.txt"
    new.parent.mkdir()
    new.write_text(as_text(answers), "utf-8")
    kept = parse_answers(path.read_text("utf-8")) if path.exists() else {}
    assert list(answers) == list(kept), f"other commands than those whose answers are kept; new: {new}"
    wrong = [line for line in answers if not is_same(answers[line], kept[line])]
    shown = []
    for line in wrong[:20]:
        old, now = (DIGESTS.sub(r"\1", text).splitlines() for text in (kept[line], answers[line]))
        shown.append("\n".join(difflib.unified_diff(old, now, line, "new", n=0, lineterm=""))[:3000])
    assert not wrong, f"{len(wrong)} answers differ; all new ones: {new}\n" + "\n".join(shown)
