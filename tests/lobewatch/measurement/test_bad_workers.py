"""Workers with invalid answers: their tasks are computed locally, and nothing wrong is stored."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acquisition import Description
from lobewatch import Logbook
from lobewatch.logbook.rebuild_history import rebuild_history
from lobewatch.logbook.replay_preview import preview_replay
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.measurement.share_work import WorkerPool, Workers, share_work
from lobewatch.measurement.tap_measurement import TapFit
from tests.lobewatch.logbook.recordings.test_store_recordings import text_files, values

SAID = Description(date_pattern="%Y-%m-%d")
CLUSTER = Workers(scheduler="tcp://bad:1")
Spoil = Callable[[Any], Any]


@pytest.fixture
def spoiled(monkeypatch: pytest.MonkeyPatch) -> Callable[[Spoil], None]:
    """Has the workers of a cluster, threads here, answer what becomes of their results."""

    def use(spoil: Spoil, whole: bool = False) -> None:
        def result(future: Future[Any]) -> Any:
            software, answer = future.result()
            return spoil(answer) if whole else (software, spoil(answer))

        @contextmanager
        def cluster(_address: str) -> Iterator[WorkerPool]:
            with ThreadPoolExecutor(2) as pool:
                yield WorkerPool(pool, 2, result)

        monkeypatch.setattr("lobewatch.measurement.share_work.connect_cluster", cluster)

    return use


def forged(record: Any, **changes: Any) -> Any:
    """Return a record with unchecked values, as from another process."""
    new = object.__new__(type(record))
    new.__dict__.update(vars(record) | changes)
    return new


def raising(error: Exception) -> Spoil:
    def fail(_: Any) -> Any:
        raise error

    return fail


def wrong_mode(**changes: Any) -> Callable[[TapFit], TapFit]:
    return lambda fit: replace(fit, modes=[forged(fit.modes[0], **changes), *fit.modes[1:]])


RUBBISH: dict[str, Spoil] = {
    "nothing": lambda _: None,
    "text": lambda _: b"sorry",
    "class": type,
    "list": lambda answer: [answer],
    "TypeError": raising(TypeError("no")),
    "MemoryError": raising(MemoryError()),
    "KeyError": raising(KeyError("x")),
    "RecursionError": raising(RecursionError()),
}
FITS: dict[str, Spoil] = {
    "another tap": lambda fit: replace(fit, tap_id="2026-01-01-000000-x-1"),
    "path": lambda fit: replace(fit, tap_id="../../x"),
    "another tool": lambda fit: replace(fit, tool="other"),
    "another time": lambda fit: replace(fit, time=None),
    "no modes": lambda fit: replace(fit, modes=None),
    "texts for modes": lambda fit: replace(fit, modes=["1713"]),
    "NaN": wrong_mode(frequency=float("nan")),
    "negative": wrong_mode(damping_ratio=-0.1),
    "text for a number": wrong_mode(stiffness="3e7"),
    "half a covariance": wrong_mode(covariance=[[1.0, 2.0]]),
    "number for modes": lambda fit: replace(fit, modes=3),
}


def machine(path: Path, n_programs: int = 0) -> Logbook:
    make_machine_folder(path, "surrogate_machine.toml")
    toml = path / "machine.toml"
    toml.write_text("[[program]]".join(toml.read_text("utf-8").split("[[program]]")[: 1 + n_programs]), "utf-8")
    return Logbook.open(path)


def test_answers_of_no_form_are_computed_here(spoiled: Callable[..., None], caplog: pytest.LogCaptureFixture) -> None:
    for spoil in (lambda _: None, lambda _: 3, lambda _: (1, 2), lambda _: ("lobewatch", 1, 2)):
        spoiled(spoil, whole=True)
        assert [*share_work(abs, [-1, -2, -3], CLUSTER)] == [1, 2, 3]
    assert len(caplog.messages) == 4
    assert "(TypeError): 3" in caplog.messages[0]


@pytest.mark.parametrize("name", RUBBISH)
def test_rubbish_of_every_kind_leaves_a_replay_as_it_is_alone(
    tmp_path: Path, spoiled: Callable[..., None], caplog: pytest.LogCaptureFixture, name: str
) -> None:
    files = text_files(tmp_path / "files", 2)
    alone, shared = machine(tmp_path / "alone"), machine(tmp_path / "shared")
    alone.replay_all(files, SAID)
    spoiled(RUBBISH[name])
    shared.replay_all(files, SAID, workers=CLUSTER)
    assert [*map(values, shared.history.rows)] == [*map(values, alone.history.rows)]
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "): 2" in caplog.messages[0]


@pytest.mark.parametrize("name", FITS)
def test_a_wrong_fit_is_never_stored_or_shown(
    tmp_path: Path, spoiled: Callable[..., None], caplog: pytest.LogCaptureFixture, name: str
) -> None:
    (file,) = text_files(tmp_path / "files", 1)
    alone, shared = machine(tmp_path / "alone"), machine(tmp_path / "shared")
    alone.replay_all([file], SAID)
    expected = [*map(values, alone.history.rows)]

    spoiled(lambda answer: forged(answer, fit=FITS[name](answer.fit)))
    (preview,) = preview_replay(shared, [file], SAID, workers=CLUSTER)
    assert preview.measurement is not None
    followed, mode = preview.measurement.followed, alone.history.rows[0].mode
    assert followed is not None
    assert mode is not None
    assert (followed.frequency, followed.stiffness) == (mode.frequency, mode.stiffness)
    shared.replay_all([file], SAID, workers=CLUSTER)
    assert [*map(values, shared.history.rows)] == expected

    spoiled(FITS[name])
    rebuild_history(shared, CLUSTER)
    assert [*map(values, Logbook.open(shared.folder.path).history.rows)] == expected
    assert len(caplog.messages) == 4  # two of them by the rebuild: fit, and words on no program


@pytest.mark.parametrize(
    "spoil",
    [
        lambda draft: forged(draft, content=draft.content[:-100]),
        lambda draft: forged(draft, content=b""),
        lambda draft: forged(draft, digest="0" * 64),
        lambda draft: forged(draft, created=None),
        lambda draft: forged(draft, entry=None),
        lambda draft: forged(draft, taken=(1,)),
    ],
    ids=["cut short", "empty", "another file", "no time", "no entry", "numbers for texts"],
)
def test_a_damaged_tap_file_of_a_worker_is_never_stored(
    tmp_path: Path, spoiled: Callable[..., None], spoil: Spoil
) -> None:
    files = text_files(tmp_path / "files", 1)
    shared = machine(tmp_path / "shared")
    spoiled(spoil)
    shared.replay_all(files, SAID, workers=CLUSTER)
    (entry,) = shared.folder.taps()
    assert shared.folder.read(entry).id == entry.id


@pytest.mark.parametrize(
    "spoil",
    [
        lambda verdicts: dict([*verdicts.items()][:-1]),
        lambda verdicts: {**verdicts, "more": None},
        lambda verdicts: [*verdicts.values()],
        lambda verdicts: dict.fromkeys(verdicts, None),
        lambda verdicts: dict(zip(verdicts, reversed(verdicts.values()), strict=True)),
        lambda verdicts: {name: replace(verdict, word="stable") for name, verdict in verdicts.items()},
        lambda verdicts: {name: replace(verdict, limit=float("nan")) for name, verdict in verdicts.items()},
        lambda verdicts: {name: replace(verdict, limit="deep") for name, verdict in verdicts.items()},
    ],
    ids=["cut short", "more", "list", "nothing", "swapped", "text for a word", "NaN", "text for a limit"],
)
def test_wrong_labels_on_programs_are_never_stored(
    tmp_path: Path, spoiled: Callable[..., None], caplog: pytest.LogCaptureFixture, spoil: Spoil
) -> None:
    logbook = machine(tmp_path / "m", 2)
    logbook.replay_all(text_files(tmp_path / "files", 1), SAID)
    rebuild_history(Logbook.open(logbook.folder.path), Workers())
    expected = [*map(repr, Logbook.open(logbook.folder.path).history.rows)]
    spoiled(lambda answer: spoil(answer) if isinstance(answer, dict) else answer)
    rebuild_history(Logbook.open(logbook.folder.path), CLUSTER)
    assert [*map(repr, Logbook.open(logbook.folder.path).history.rows)] == expected
    assert len(caplog.messages) == 1
