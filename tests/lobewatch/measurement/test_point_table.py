"""points.csv: separators, decimal signs, optional columns and order."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition import DataError
from lobewatch.measurement.point_table import PointRow, read_point_table


def write(folder: Path, *lines: str) -> tuple[PointRow, ...]:
    """Write and read a table whose files are there."""
    (folder / "a.csv").touch()
    (folder / "points.csv").write_text("\n".join(lines), encoding="utf-8-sig")
    return read_point_table(folder)


def test_rows_are_ordered_from_the_tip_whatever_the_separator(tmp_path: Path) -> None:
    lines = ["file,Part,position_mm,point", "a.csv,column,300,rear", "a.csv,tool,0,tip", "a.csv,holder,62.5,nut", ""]
    by_comma = write(tmp_path, *lines)
    by_semicolon = write(tmp_path, *(line.replace(",", ";").replace("62.5", "62,5") for line in lines))
    by_tab = write(tmp_path, *(line.replace(",", "\t") for line in lines))
    assert [row.point for row in by_comma] == ["tip", "nut", "rear"]
    assert [row.position for row in by_comma] == [0.0, 0.0625, 0.3]
    assert by_comma == by_semicolon == by_tab


def test_optional_columns_have_defaults(tmp_path: Path) -> None:
    head = "point,position_mm,part,file,role,direction,number,node"
    rows = write(tmp_path, head, "a,0,tool,a.csv,,,,1", "b,10,tool,a.csv,hit,-X,2,", "c,20,holder,a.csv")
    assert [(row.role, row.direction, row.number, row.node) for row in rows] == [
        ("response", "", None, 1),
        ("hit", "-x", 2, None),
        ("response", "", None, None),
    ]


@pytest.mark.parametrize(
    ("line", "facts"),
    [
        ("b,10,tool,a.csv,push,,,", ("line 3", "b", "push")),
        ("b,10,tool,a.csv,,up,,", ("line 3", "b", "up")),
        ("b,10,tool,a.csv,,,1.5,", ("line 3", "b", "1.5")),
        ("b,10,tool,a.csv,,,1,2", ("line 3", "b", "number 1", "node 2")),
        ("b,inf,tool,a.csv,,,,", ("line 3", "b", "inf")),
        (",10,tool,a.csv,,,,", ("line 3", "name")),
        ("b,10,tool,,,,,", ("line 3", "b")),
        ("b,0,tool,a.csv,,,,", ("line 3", "b", "point a")),
        ("b,-5,column,a.csv,,,,", ("line 3", "b", "column")),
        ("b,10,tool,a.csv,,,,,9", ("line 3", "9 values", "8 columns")),
    ],
)
def test_a_wrong_cell_is_named_with_its_line(tmp_path: Path, line: str, facts: tuple[str, ...]) -> None:
    head = "point,position_mm,part,file,role,direction,number,node"
    with pytest.raises(DataError) as wrong:
        write(tmp_path, head, "a,0,tool,a.csv", line, "c,20,holder,a.csv")
    assert [fact for fact in facts if fact not in str(wrong.value)] == []


def test_points_in_one_position_are_refused(tmp_path: Path) -> None:
    lines = ("a,50,tool,a.csv", "b,50,holder,a.csv", "c,50,spindle,a.csv")
    with pytest.raises(DataError, match=r"points\.csv: position_mm 50"):
        write(tmp_path, "point,position_mm,part,file", *lines)


def test_a_table_in_another_encoding_is_refused(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_bytes(b"point,position_mm,part,file\n\xfc,0,tool,a.csv\n")
    with pytest.raises(DataError, match="UTF-8"):
        read_point_table(tmp_path)
