"""What `lobewatch rebuild` does once its options are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from acquisition import DataError
from lobewatch.logbook import Logbook
from lobewatch.logbook.rebuild_history import rebuild_history
from lobewatch.machine.archive.rebuild import rebuild_files
from lobewatch.machine.contents import tap_files
from lobewatch.measuring.workers.share_work import Workers
from lobewatch.show.terminal.output import emit, notes
from lobewatch.show.terminal.remarks import remark_json, remark_lines

After = Callable[[Logbook], None]
"""What is done with a machine once it is rebuilt."""


def show_rebuild(path: Path, workers: Workers, after: After, *, as_json: bool) -> None:
    """Rebuild a machine, or each of a folder, and tell; DataError for those that cannot be."""
    machines = _machines(path)
    if not machines:
        payload, texts = _rebuilt(path, workers, after)
        emit(payload, as_json, *texts)
        return
    told, lines, refused = dict[str, Any](), list[str](), list[str]()
    for machine in machines:
        try:
            payload, texts = _rebuilt(machine, workers, after)
        except DataError as error:
            refused.append(str(error))
            continue
        told[machine.name] = payload
        lines += [f"{machine.name}: {text}" for text in texts]
    emit({"machines": told}, as_json, *lines, f"{len(told)} of {len(machines)} machines rebuilt")
    if refused:
        raise DataError("\n".join([f"{len(refused)} of {len(machines)} machines cannot be rebuilt", *refused]))


def _machines(path: Path) -> list[Path]:
    """The machine folders in a folder that is none itself."""
    if (path / "machine.toml").is_file() or tap_files(path):
        return []
    return sorted(one for one in path.glob("*/") if (one / "machine.toml").is_file() or tap_files(one))


def _rebuilt(path: Path, workers: Workers, after: After) -> tuple[dict[str, Any], list[str]]:
    """What there is to tell, as JSON and as text."""
    done = rebuild_files(path)
    logbook = Logbook.open(path)
    n_rows = rebuild_history(logbook, workers, lambda number, of: _progress(path, number, of))
    if any(one.code == "history-in-memory" for one in logbook.remarks):
        made = "history.rows: not made anew (see above); the next command that can write makes it"
    else:
        made = f"history.rows: made anew from {n_rows} tap test(s)"
    after(logbook)
    payload = {"done": done, "tap_tests": n_rows, "remarks": [remark_json(one) for one in logbook.remarks]}
    return payload, [*done, *remark_lines(logbook.remarks), made]


def _progress(path: Path, number: int, of: int) -> None:
    if number % 10 == 0:
        notes.print(f"{path.name}: {number} of {of} tap tests", markup=False)
