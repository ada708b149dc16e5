"""Names and texts with any characters: output is exact and valid, or one clear error."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
import sys
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id
from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from modal import Mode, synthesize_frf

LINES = np.arange(4.0, 4000.0, 4.0)
FRF = from_accelerance(LINES, synthesize_frf([Mode(1713.0, 0.029, 3.5e7)], LINES).accelerance)
TEXTS = st.text(st.characters(), min_size=1, max_size=60).filter(str.strip)
"""All characters, halves of them too."""


def said(*arguments: object) -> tuple[int, str]:
    """Exit code and stdout of a command that must end in results or in one clear error."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="") for _ in range(2))
    with (
        patch.object(sys, "argv", ["lobewatch", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as end,
    ):
        main()
    texts = []
    for stream in (out, err):
        stream.seek(0)
        texts.append(stream.read())
    assert "Traceback" not in texts[1]
    assert not re.search(r"error: [A-Z]\w*Error\b", texts[0] + texts[1])
    return int(end.value.code or 0), texts[0]


def check_all(plant: Path, folder: Path) -> None:
    """Check that JSON and CSV of every command are valid and hold the names."""
    status = json.loads(said("status", plant, "--json")[1])
    (line,) = csv.DictReader(io.StringIO(said("status", plant, "--csv")[1]))
    assert line["name"].lstrip("'") == status["machines"][0]["name"].lstrip("'")
    json.dumps(status, ensure_ascii=False).encode()
    said("history", folder, "--json")
    assert said("export", plant, plant / "x.csv")[0] in (0, 2)


def any_name(machine: str, tool: str, program: str, event: str) -> None:
    with TemporaryDirectory() as made:
        plant = Path(made)
        toml = make_machine_folder(plant / "m", "surrogate_machine.toml")
        text = toml.read_text("utf-8")
        for old, new in (('"m"', machine), ('"A: slot at 12 600 rpm"', program)):
            text = text.replace(old, json.dumps(new))
        text = text.replace("high_rpm = 24000", "high_rpm = 24000\nsteps = 100")
        toml.write_text(text, "utf-8")
        folder = MachineFolder(plant / "m")
        with contextlib.suppress(ValueError):
            about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC), tool, operator=tool)
            folder.commit(TapTest(new_tap_id(about), about, FRF))
        code, _ = said("event", folder.path, "--", event)
        seen, history = said("history", folder.path, "--json")
        if seen == 0:
            assert [one["text"] for one in json.loads(history)["events"]] == ([event] if code == 0 else [])
        check_all(plant, folder.path)


@settings(max_examples=10, deadline=None)
@example("<img src=x onerror=alert(1)>", "\u202egnp.exe", "\u2028", "-rf")
@example("a\u200bb\ufeff", "🛠️", "W" * 255, "\u0301")
@example("\ud800", "\x00", "\udcff", "\udcff")
@given(TEXTS, TEXTS, TEXTS, TEXTS)
def test_any_name_is_shown_or_rejected(machine: str, tool: str, program: str, event: str) -> None:
    any_name(machine, tool, program, event)


@pytest.mark.long
@pytest.mark.timeout(1800)
@settings(max_examples=300, deadline=None)
@given(TEXTS, TEXTS, TEXTS, TEXTS)
def test_three_hundred_names_are_shown_or_rejected(machine: str, tool: str, program: str, event: str) -> None:
    any_name(machine, tool, program, event)


@pytest.mark.parametrize(
    "name",
    [
        "-m",
        "--json",
        "\u202em",
        "a\u2028b",
        "\u200b",
        "🛠️",
        "ä" * 127,
        "W" * 255,
        "a\nb",
        "a\x1b[2J",
        "b\udcff",
        "<b>",
        "a b\\",
    ],
)
def test_a_folder_of_any_name_is_shown_or_rejected(name: str, tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    plant = tmp_path / "plant"
    plant.mkdir()
    (tmp_path / "m").rename(plant / name)
    check_all(plant, plant / name)
