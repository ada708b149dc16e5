"""The files of interrupted tests against what was written: hits by their seals, the set-up by its CRC-32."""

from __future__ import annotations

import json
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path

from acquisition import Remark, Trigger
from acquisition.errors import failure_text
from acquisition.files.seal import is_sealed
from acquisition.regular_file import SMALL, read_regular
from lobewatch.machine.journal.journal import command

ALTERED = "altered or cut short since it was written"


def damaged_file(about: str, text: str, cure: str = "") -> Remark:
    """Remark on a file that is missing or not as it was written, and that nothing else has a word for."""
    return Remark("file-damaged", about, text, cure)


def file_set_aside(about: str, text: str, cure: str) -> Remark:
    """Remark on a file that harms nothing."""
    return Remark("set-aside", about, text, cure)


def verify_spool(folder: Path, saved: Collection[str]) -> Iterator[Remark]:
    """Remarks on the files of interrupted tests.

    saved: identities of tap tests that need theirs no more. What another program removes meanwhile is left out.
    """
    spool = folder / "spool"
    for path in sorted(spool.rglob("*")) if spool.is_dir() else []:
        if path.relative_to(spool).parts[0] in saved:
            continue
        try:
            yield from _verify_test(folder, path) if path.is_dir() else _verify_file(folder, path)
        except FileNotFoundError:
            continue
        except OSError as error:
            yield damaged_file(path.relative_to(folder).as_posix(), failure_text(error).removeprefix(f"{path}: "))


def _verify_test(folder: Path, path: Path) -> Iterator[Remark]:
    cure = f"put it back from a backup, or {command('tap', folder)} goes on with the others{_or_delete(path)}"
    about = path.relative_to(folder).as_posix()
    yield from (damaged_file(f"{about}/{name}", "missing", cure) for name in _missing_hits(path))


def _verify_file(folder: Path, path: Path) -> Iterator[Remark]:
    about, tap = path.relative_to(folder).as_posix(), command("tap", folder)
    if path.suffix == ".h5" and not is_sealed(read_regular(path)):
        cure = f"{tap} sets it aside and goes on with the others{_or_delete(path.parent)}"
        yield damaged_file(about, ALTERED, cure)
    elif path.name == "setup.json" and not _is_whole_set_up(path):
        cure = f"{tap} sets it aside and chooses the set-up anew{_or_delete(path.parent)}"
        yield damaged_file(about, ALTERED, cure)
    elif path.suffix == ".tmp":
        yield file_set_aside(about, "half written", f"{tap} removes it")
    elif path.suffix == ".damaged":
        cure = "delete it when you do not need it"
        yield file_set_aside(about, "a damaged file of an interrupted test", cure)


def _or_delete(test: Path) -> str:
    return f"; a test of more than 12 hours ago is not gone on with: delete {test} where you do not need it"


def _is_whole_set_up(path: Path) -> bool:
    try:
        settings = json.loads(read_regular(path, SMALL))
        crc = settings.pop("crc", None)
        return bool(Trigger(**settings)) and crc in (None, zlib.crc32(json.dumps(settings, sort_keys=True).encode()))
    except (ValueError, TypeError, AttributeError, RecursionError):
        return False


def _missing_hits(test: Path) -> list[str]:
    """Names of hits that must have been there: one with a higher number is, and none was set aside under theirs."""
    numbers = [int(path.stem) for path in test.glob("[0-9]*.h5") if path.stem.isdigit()]
    names = [f"{number:04d}.h5" for number in range(max(numbers, default=0)) if number not in numbers]
    return [name for name in names if not list(test.parent.glob(f"{test.name}-{name}*.damaged"))]
