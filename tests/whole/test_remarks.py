"""Every code of a remark is documented."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch")
CODE = r"[a-z]+(?:-[a-z]+)*"


def made() -> Iterator[str]:
    """Codes of all remarks that our packages make with a code that is written out."""
    for package in PACKAGES:
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Remark":
                    code = node.args[0] if node.args else None
                    if isinstance(code, ast.Constant):
                        yield str(code.value)


def documented() -> list[str]:
    page = (ROOT / "docs" / "remarks.md").read_text(encoding="utf-8")
    return re.findall(rf"^\| `({CODE})` \| [^|]+ \| [^|]+ \|$", page, re.MULTILINE)


def test_every_code_is_documented_once() -> None:
    codes = set(made())
    assert {"cut-by-edge", "no-mode-to-follow", "sign-swapped"} <= codes
    assert codes <= set(documented())
    assert len(documented()) == len(set(documented()))


def test_codes_are_words_joined_by_hyphens() -> None:
    assert all(re.fullmatch(CODE, code) for code in made())
