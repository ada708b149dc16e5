"""Two people, programs and an editor change one machine.toml: no change is lost without a question."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import DataError
from lobewatch.machine import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.folder_updates import accept_settings, save_program
from lobewatch.machine.settings.cut_tables import ProgramTable
from lobewatch.machine.settings.display_units import shown_units
from lobewatch.machine.settings.toml import TablePath, edit_toml, parse_toml_tables, read_toml_text, write_toml_text
from lobewatch.machine.setup_questions.draft import MachineDraft
from lobewatch.machine.setup_questions.machine_file_changes import change_machine_file, create_machine_file
from lobewatch.machine.setup_questions.questions import find_setup_question

KEYS = {"drive": ("power_kw", "torque_nm"), "speed": ("low_rpm", "high_rpm")}
QUESTIONS = {"drive": "drive", "speed": "speeds"}
PEOPLE, TABLES = st.sampled_from([0, 1]), st.sampled_from(["drive", "speed"])
VALUES = st.tuples(st.integers(10, 12), st.integers(40, 41))
STEPS = st.one_of(
    st.tuples(st.just("open"), PEOPLE),
    st.tuples(st.just("answer"), PEOPLE, TABLES, VALUES, st.booleans()),
    st.tuples(st.just("edit"), VALUES),
    st.tuples(st.just("save")),
)

TEXT = """# ours
[machine]  # by hand
name = "m"

[speed]
low_rpm = 9
high_rpm = 24000

# from the type plate
[drive]
power_kw = 9
torque_nm = 39

[tap]
tool = "reference"
"""
COMMENTED = ["# ours", "[machine]  # by hand", "# from the type plate"]


def program(name: str) -> ProgramTable:
    cut: dict[str, Any] = {"teeth": 4, "tool_diameter_mm": 20, "radial_depth_mm": 20, "direction": "down"}
    return ProgramTable(name=name, tool="reference", material="42CrMo4", speed_rpm=5000, depth_mm=1, **cut)


class Shop:
    """Machine folder, and the expected values in its machine.toml."""

    def __init__(self, path: Path) -> None:
        path.mkdir()
        self.toml = path / "machine.toml"
        self.toml.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
        self.toml.chmod(0o600)
        self.values: dict[str, tuple[Any, ...]] = {"drive": (9, 39), "speed": (9, 24000)}
        self.programs = list[str]()
        self.shown: dict[int, tuple[str, dict[str, tuple[Any, ...]]]] = {}

    def open(self, person: int) -> None:
        self.shown[person] = read_toml_text(self.toml), dict(self.values)

    def answer(self, person: int, table: str, values: tuple[int, int], overwrites: bool) -> None:
        """Answer to the text that this person has seen; the present values decide whether there is a question."""
        if person not in self.shown:
            return
        seen, shown = self.shown.pop(person)
        answer = f"{values[0]} {1000 * values[1] if table == 'speed' else values[1]}"
        wanted = tuple(map(int, answer.split()))
        draft = MachineDraft(seen, {}).answer(find_setup_question(QUESTIONS[table]), answer)
        clashes = zip(KEYS[table], shown[table], self.values[table], wanted, strict=True)
        asked = [(f"{table} {key}", now, new) for key, old, now, new in clashes if now not in (old, new)]
        asks, refusal = list[Any](), ""

        def may_overwrite(conflicts: Any) -> bool:
            asks.extend(map(tuple, conflicts))
            return overwrites

        try:
            change_machine_file(self.toml.parent, draft.repeat_edits, seen, may_overwrite)
            self.values[table] = wanted
        except DataError as error:
            refusal = str(error)
        assert asks == asked
        assert bool(refusal) == (bool(asked) and not overwrites)
        assert all(f"{now}" in refusal and f"{new}" in refusal for _, now, new in asked if refusal)

    def edit(self, values: tuple[int, int]) -> None:
        """Save the file in an editor that knows no lock."""
        text = edit_toml(read_toml_text(self.toml), TablePath("drive"), dict(zip(KEYS["drive"], values, strict=True)))
        write_toml_text(self.toml, text)
        self.values["drive"] = values

    def save(self) -> None:
        self.programs.append(f"new {len(self.programs)}")
        save_program(MachineFolder(self.toml.parent), program(self.programs[-1]))

    def check(self) -> None:
        content = self.toml.read_bytes()
        text = content.decode().removeprefix("\ufeff")
        tables = parse_toml_tables(text)
        assert {name: tuple(tables[name][key] for key in keys) for name, keys in KEYS.items()} == self.values
        assert [table["name"] for table in tables.get("program", ())] == self.programs
        assert [line for line in text.split("\r\n") if "#" in line] == COMMENTED
        assert content.startswith(b"\xef\xbb\xbf")
        assert content.count(b"\n") == content.count(b"\r\n")
        assert self.toml.stat().st_mode & 0o777 == 0o600


def interleave(path: Path, steps: list[tuple[Any, ...]]) -> None:
    shop = Shop(path)
    for name, *arguments in steps:
        getattr(shop, name)(*arguments)
        shop.check()


@settings(max_examples=25, deadline=None)
@given(st.lists(STEPS, min_size=3, max_size=10))
def test_any_order_of_questions_programs_and_edits_keeps_all(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[Any, ...]]
) -> None:
    interleave(tmp_path_factory.mktemp("mills") / "m", steps)


@pytest.mark.long
@settings(max_examples=1000, deadline=None)
@given(st.lists(STEPS, min_size=3, max_size=20))
def test_a_thousand_orders_of_questions_programs_and_edits_keep_all(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[Any, ...]]
) -> None:
    interleave(tmp_path_factory.mktemp("mills") / "m", steps)


def test_all_programs_and_answers_of_many_threads_are_in_the_file(tmp_path: Path) -> None:
    toml = make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    text = edit_toml(read_toml_text(toml), TablePath("tap"), {"sensor_mass_g": 1500})
    toml.write_text(edit_toml(text, TablePath("drive"), {"power_kw": 1e-3, "torque_nm": 40}), "utf-8")
    before = [table.name for table in MachineFolder(toml.parent).machine.program]
    names = {f"thread {number}" for number in range(6)}
    work: list[Callable[[], object]] = []
    work += [partial(save_program, MachineFolder(toml.parent), program(name)) for name in names]
    work += [partial(accept_settings, MachineFolder(toml.parent), [key]) for key in ("sensor_mass_g", "power_kw")]
    threads = [threading.Thread(target=action) for action in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    machine = MachineFolder(toml.parent).machine
    assert {table.name for table in machine.program} == {*before, *names}
    assert len(machine.program) == len(before) + len(names)
    assert len(machine.machine.accepted) == 2


def test_of_two_who_make_the_same_machine_the_second_is_refused(tmp_path: Path) -> None:
    create_machine_file(tmp_path / "m", '[machine]\nname = "first"\n')
    with pytest.raises(DataError, match=r"machine\.toml: file already exists"):
        create_machine_file(tmp_path / "m", '[machine]\nname = "second"\n')
    assert "first" in (tmp_path / "m" / "machine.toml").read_text("utf-8")


def test_an_answer_that_no_longer_fits_is_named_and_not_written(tmp_path: Path) -> None:
    toml = make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    seen = read_toml_text(toml)
    draft = MachineDraft(seen, {}).answer(find_setup_question("program"), "slot: 20000 2 16")
    present = edit_toml(seen, TablePath("speed"), {"low_rpm": 1000, "high_rpm": 12000})
    toml.write_text(present, "utf-8")
    with pytest.raises(DataError, match=r"machine\.toml has changed, .*20000"):
        change_machine_file(toml.parent, draft.repeat_edits, seen, lambda _: True)
    assert toml.read_text("utf-8") == present


def test_an_answer_keeps_its_units_if_somebody_changes_the_units_of_the_machine(tmp_path: Path) -> None:
    toml = make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    seen = read_toml_text(toml)
    with shown_units("inch"):
        draft = MachineDraft(seen, {}).answer(find_setup_question("tool"), "4 1 30")
    with shown_units("metric"):
        change_machine_file(toml.parent, draft.repeat_edits, seen)
    assert parse_toml_tables(read_toml_text(toml))["reference_cut"]["tool_diameter_mm"] == pytest.approx(25.4)


def test_a_first_program_that_is_another_one_now_is_not_changed_unasked(tmp_path: Path) -> None:
    toml = make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    seen = read_toml_text(toml)
    draft = MachineDraft(seen, {}).answer(find_setup_question("material"), "AA 6061")
    first = parse_toml_tables(seen)["program"][0]["name"]
    toml.write_text(seen.replace(json.dumps(first), '"other"'), "utf-8")
    with pytest.raises(DataError, match=r"program 'other' tangential_n_per_mm2"):
        change_machine_file(toml.parent, draft.repeat_edits, seen)
