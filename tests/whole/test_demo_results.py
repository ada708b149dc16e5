"""Output of the demo and of the commands on it, compared word by word with the last reviewed output.

A change that is meant shows here: the new text lies in the folder that the failure names, to be read and copied.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from datetime import datetime, tzinfo
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from typer.testing import CliRunner

import lobewatch
from acquisition import find_driver
from acquisition.emulation import Passage
from lobewatch.cli import app
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.show.figures.drawing import render_svg, save_figure
from lobewatch.show.report import section
from lobewatch.tap.emulated_cut import emulate_cut

DATA = Path(__file__).parents[1] / "data"
SEEN = DATA / "demo"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ARBITRARY = re.compile(r"(?<=[xy]_)[0-9]{4}\b|(?<=\"worst_feed_deg\": )[0-9.]+|(?<=by lobewatch )[0-9.]+\d")
"""Ends of identities, which of two directions of feed with the same limit is named (rounding decides), the version."""
SAME = 3e-5
"""Relative difference that another processor makes at most: 6e-6 was seen."""
QUESTIONS = {
    "demo": "demo --seed 5",
    "check": "check DEMO",
    "check.json": "check DEMO --json",
    "trend": "trend DEMO",
    "trend.json": "trend DEMO --json",
    "suggest": "suggest DEMO --program B --json",
    "lobes": "lobes DEMO --figure lobes.png",
    "lobes.json": "lobes DEMO --method zero-order --json --radial radial.png --waterfall waterfall.png",
    "model": "model DEMO --figure model.png",
    "model.json": "model DEMO --tool LONG --json",
    "history": "history DEMO",
    "history.json": "history DEMO --json",
    "status": "status DEMO",
    "modes.json": "modes BEAM --json --figure modes.png",
    "listen": "listen DEMO --program A --depth 6 --port PORT --out listen.png",
    "check learnt": "check DEMO --json",
    "suggest learnt": "suggest DEMO --program A --json",
    "lobes learnt": "lobes DEMO --cut A --figure learnt.png",
    "report": "report DEMO",
}
"""Commands by the name of what they print, in this order."""
TEXTS = [name for name, command in QUESTIONS.items() if "--json" not in command and not command.startswith("report")]
"""Names of the answers that are text for people."""
MEANT = {
    "DEMO": "lobewatch-demo",
    "LONG": "long end mill",
    "A": "A: slot at 12 600 rpm",
    "B": "B: slot at 6 200 rpm",
    "BEAM": "acceleration.lvm",
}
ORDINATES = ("natural frequency", "bearing stiffness", "limiting depth ap", "receptance")
"""Names of the pictures of the report."""
PICTURES = ("lobes", "radial", "waterfall", "model", "modes", "listen", "learnt", *(f"report {y}" for y in ORDINATES))
SMALLER = 3
"""Dots of a picture, each way, that are one in what is kept."""
PALE = 3.0
"""Difference of such a dot (of 255) that no eye sees."""


class December(datetime):
    """A clock that stands five days after the last test of the demo; what it makes are plain times."""

    def __new__(cls, *parts: Any, **named: Any) -> Any:
        """Return a plain time, as encoders of times know no other type."""
        return datetime(*parts, **named)  # noqa: DTZ001

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Any:
        """Return a fixed time."""
        return cls(2025, 12, 20, 9, tzinfo=tz)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Yield printed output by name; pictures are in the working directory."""
    with pytest.MonkeyPatch.context() as patch:
        for name in [module.name for module in pkgutil.walk_packages(lobewatch.__path__, "lobewatch.")]:
            module = importlib.import_module(name)
            if getattr(module, "datetime", None) is datetime:
                patch.setattr(module, "datetime", December)
        patch.setattr(section, "render_svg", svg_and_png)
        count, token = itertools.count(), secrets.token_hex
        patch.setattr(secrets, "token_hex", lambda size: f"{next(count):04d}" if size == 2 else token(size))
        patch.setenv("TZ", "UTC")
        time.tzset()
        patch.chdir(tmp_path_factory.mktemp("demo"))
        shutil.copy(DATA / "ladisk_beam" / "acceleration.lvm", ".")
        printed = {name: answer(command) for name, command in QUESTIONS.items()}
        page = Path("lobewatch-demo/report.html").read_text("utf-8")
        printed["report"] = re.sub(r"<(style|script|svg).*?</\1>\n*", "", page, flags=re.DOTALL)
        yield {name: ARBITRARY.sub("0", text) for name, text in printed.items()}
    time.tzset()


def svg_and_png(figure: Figure) -> str:
    """Render a report figure as SVG, and save it as PNG named after its ordinate."""
    save_figure(figure, Path(f"report {figure.axes[0].get_ylabel().partition(' (')[0]}.png"))
    return render_svg(figure)


def answer(command: str) -> str:
    """Return the output of a command, with the port of the emulated cut if it needs one."""
    with port_of_a_cut() if "PORT" in command else nullcontext("") as port:
        words = [(MEANT | {"PORT": port}).get(word, word) for word in command.split()]
        told = CliRunner(env={"COLUMNS": "80"}).invoke(app, words)
    assert told.exit_code in (0, 1), told.output
    return told.stdout


@contextmanager
def port_of_a_cut() -> Iterator[str]:
    """Emulate program A, cut too deep again and again."""
    folder, passage = MachineFolder("lobewatch-demo"), Passage(before=1.2, ramp=0.05, steady=0.7, after=0.6)
    setting = find_cut_setting(folder.machine, MEANT["A"], None, 6.0)
    with emulate_cut(folder, find_driver("taps"), setting, realtime=False, passage=passage).device as device:
        yield device.port


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", QUESTIONS)
def test_the_answer_is_the_one_that_was_inspected(demo: dict[str, str], name: str, tmp_path: Path) -> None:
    seen, new = SEEN / f"{name}.txt", tmp_path / f"{name}.txt"
    new.write_text(demo[name], "utf-8")
    expected = seen.read_text("utf-8") if seen.exists() else ""
    assert NUMBER.split(demo[name]) == NUMBER.split(expected), f"what is new: {new}"
    found, wanted = ([*map(float, NUMBER.findall(text))] for text in (demo[name], expected))
    assert found == pytest.approx(wanted, rel=SAME, abs=1e-12), f"what is new: {new}"


@pytest.mark.timeout(300)
def test_tables_fit_eighty_columns_and_no_number_has_an_exponent(demo: dict[str, str]) -> None:
    lines = {name: [line for line in demo[name].splitlines() if re.search(r"\S {2,}\S", line)] for name in TEXTS}
    assert {name for name, rows in lines.items() if len(rows) > 1} >= {"demo", "check", "trend", "lobes", "history"}
    assert [line for rows in lines.values() for line in rows if len(line) > 80] == []
    assert [line for name in TEXTS for line in demo[name].splitlines() if re.search(r"\d[eE][-+]?\d", line)] == []


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.usefixtures("demo")
def test_the_picture_is_the_one_that_was_inspected(name: str, tmp_path: Path) -> None:
    seen, new = SEEN / f"{name}.png", tmp_path / f"{name}.png"
    with Image.open(f"{name}.png") as drawn:
        drawn.convert("RGB").reduce(SMALLER).save(new, optimize=True)
    found, expected = pixels(new), pixels(seen)
    assert found.shape == expected.shape, f"what is new: {new}"
    assert np.max(np.abs(found - expected)) < PALE, f"what is new: {new}"


def pixels(path: Path) -> NDArray[np.float64]:
    """Colours of a picture, 0 to 255."""
    with Image.open(path) as picture:
        return np.asarray(picture, dtype=np.float64)
