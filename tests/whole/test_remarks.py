"""Every code of a remark is documented, written alike, and has one home."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch")
CODE = r"[a-z]+(?:-[a-z]+)*"
SHARED: dict[str, str] = {}
"""Codes that several modules give, each with the reason why they mean the same."""


def trees() -> Iterator[tuple[str, ast.AST]]:
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            yield str(file.relative_to(ROOT)), ast.parse(file.read_text(encoding="utf-8"))


def codes_of(tree: ast.AST) -> Iterator[str]:
    """First arguments of Remark(...) that are written out, both branches of a choice between two."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("Remark", "FitRemark"):
            given = [*node.args[:1], *(keyword.value for keyword in node.keywords if keyword.arg == "code")]
            for one in ast.walk(given[0]):
                if isinstance(one, ast.Constant) and not isinstance(given[0], ast.JoinedStr):
                    yield str(one.value)


def homes() -> dict[str, set[str]]:
    """Return the modules that give each code."""
    found: dict[str, set[str]] = defaultdict(set)
    for file, tree in trees():
        for code in codes_of(tree):
            found[code].add(file)
    return found


def documented() -> list[str]:
    page = (ROOT / "docs" / "remarks.md").read_text(encoding="utf-8")
    return re.findall(rf"^\| `({CODE})`(?: \*)? \| [^|]+ \| [^|]+ \|$", page, re.MULTILINE)


def test_every_code_is_documented_once_and_none_that_is_not_given() -> None:
    codes = homes()
    assert {"calibration-old", "range-too-small", "low-immersion"} <= codes.keys()
    assert sorted(codes.keys() - set(documented())) == []
    assert len(documented()) == len(set(documented()))
    written = {node.value for _, tree in trees() for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert sorted(set(documented()) - written) == []


def test_codes_are_words_joined_by_hyphens() -> None:
    assert [code for code in homes() if not re.fullmatch(CODE, code)] == []


def test_a_code_has_one_home() -> None:
    several = {code: files for code, files in homes().items() if len(files) > 1 and code not in SHARED}
    assert several == {}
    assert {code for code in SHARED if len(homes().get(code, ())) < 2} == set()


def test_the_codes_that_end_sensors_with_an_error_are_marked() -> None:
    from lobewatch.tap.self_check import SENSOR_ERROR_CODES

    page = (ROOT / "docs" / "remarks.md").read_text(encoding="utf-8")
    assert set(re.findall(rf"^\| `({CODE})` \* \|", page, re.MULTILINE)) == SENSOR_ERROR_CODES
