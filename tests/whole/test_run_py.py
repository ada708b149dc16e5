"""run.py: the environment is made once, exit statuses are passed on, and missing parts are reported in one sentence."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run_py(tmp_path: Path) -> ModuleType:
    """Return run.py, copied to a folder of its own, as a module."""
    for path in (ROOT / "run.py", ROOT / "pyproject.toml", *ROOT.glob("requirements*.lock")):
        shutil.copy(path, tmp_path)
    spec = importlib.util.spec_from_file_location("run_py", tmp_path / "run.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def recording(commands: list[list[str]], status: int) -> Callable[[list[str]], int]:
    """Stands in for subprocess.call: keeps the command and gives a status."""

    def call(command: list[str]) -> int:
        commands.append(command)
        return status

    return call


def present(run_py: ModuleType, extras: str) -> None:
    Path(run_py.place(extras)).mkdir()
    (Path(run_py.place(extras)) / "lobewatch-stamp").write_text(run_py.stamp(extras))


def test_an_old_python_is_told_which_one_is_needed(run_py: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_py.sys, "version_info", (3, 10, 2))
    with pytest.raises(SystemExit, match=r"3\.11.*\d\.\d"):
        run_py.main()


def test_run_py_is_grammar_that_an_old_python_understands() -> None:
    source = (ROOT / "run.py").read_text(encoding="utf-8")
    compile(source, "run.py", "exec", dont_inherit=True)
    for word in ('f"', "f'", ":=", "file=sys", " -> ", "async "):
        assert word not in source, word


def test_neither_pip_nor_uv_is_reported_in_one_sentence_with_the_cure(
    run_py: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_py.subprocess, "call", lambda *_, **__: 1)
    monkeypatch.setattr(run_py.shutil, "which", lambda _: None)
    with pytest.raises(SystemExit, match=r"pip.*uv"):
        run_py.make_environment("")


def test_uv_serves_where_there_is_no_pip(run_py: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_py.subprocess, "call", lambda *_, **__: 1)
    monkeypatch.setattr(run_py.shutil, "which", lambda _: "/bin/uv")
    assert run_py.installer("")[:3] == ["/bin/uv", "pip", "install"]


@pytest.mark.parametrize(
    ("made_for", "asked", "calls"),
    [("", "", 0), ("[dev]", "", 0), ("", "[dev]", 3), ("[dev]", "[bench]", 3), ("[bench]", "[bench]", 0)],
)
def test_an_environment_that_holds_all_is_not_made_again(
    run_py: ModuleType, monkeypatch: pytest.MonkeyPatch, made_for: str, asked: str, calls: int
) -> None:
    present(run_py, made_for)
    made: list[list[str]] = []
    monkeypatch.setattr(run_py, "installer", lambda _: ["install"])
    monkeypatch.setattr("venv.create", lambda folder, **_: Path(folder).mkdir(exist_ok=True))
    monkeypatch.setattr(run_py.subprocess, "call", recording(made, 0))
    run_py.make_environment(asked)
    assert len(made) == calls


@pytest.mark.parametrize(
    ("name", "extras"),
    [
        ("pyproject.toml", ""),
        ("requirements.lock", ""),
        ("requirements-dev.lock", "[dev]"),
        ("requirements-bench.lock", "[bench]"),
    ],
)
def test_a_changed_pyproject_or_lock_makes_it_again(run_py: ModuleType, name: str, extras: str) -> None:
    before = run_py.stamp(extras)
    with (Path(run_py.ROOT) / name).open("a") as file:
        file.write("# changed\n")
    assert run_py.stamp(extras) != before


def test_what_is_installed_is_what_is_locked(run_py: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[list[str]] = []
    monkeypatch.setattr(run_py, "installer", lambda _: ["install"])
    monkeypatch.setattr("venv.create", lambda folder, **_: Path(folder).mkdir())
    monkeypatch.setattr(run_py.subprocess, "call", recording(made, 0))
    run_py.make_environment("[dev]")
    assert made[0] == [
        "install",
        "--require-hashes",
        "--no-deps",
        "-r",
        str(Path(run_py.ROOT) / "requirements-dev.lock"),
    ]
    assert made[2] == ["install", "--no-deps", "--editable", run_py.ROOT]


def test_a_lock_that_does_not_fit_gives_way_to_what_pyproject_allows(
    run_py: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made: list[list[str]] = []

    def call(command: list[str]) -> int:
        made.append(command)
        return int("--require-hashes" in command)

    monkeypatch.setattr(run_py, "installer", lambda _: ["install"])
    monkeypatch.setattr("venv.create", lambda folder, **_: Path(folder).mkdir())
    monkeypatch.setattr(run_py.subprocess, "call", call)
    run_py.make_environment("[dev]")
    assert made[-1] == ["install", "--editable", f"{run_py.ROOT}[dev]"]
    assert "pyproject.toml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "ran"),
    [
        ([], ["lobewatch.cli", "demo"]),
        (["modes", "x.lvm"], ["lobewatch.cli", "modes", "x.lvm"]),
        (["test"], ["pytest", "-n", "auto", "--dist", "worksteal"]),
        (
            ["test", "--long"],
            ["pytest", "-n", "auto", "--dist", "worksteal", "-m", "long or not long", "--timeout", "3600", "--cov"],
        ),
        (["test", "tests/dsm", "--long"], ["pytest", "-m", "long or not long", "--timeout", "3600", "tests/dsm"]),
    ],
)
def test_what_is_run_and_that_its_status_is_passed_on(
    run_py: ModuleType, monkeypatch: pytest.MonkeyPatch, arguments: list[str], ran: list[str]
) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(run_py.sys, "argv", ["run.py", *arguments])
    monkeypatch.setattr(run_py, "make_environment", lambda _: None)
    seen: list[list[str]] = []
    monkeypatch.setattr(run_py.subprocess, "call", recording(seen, 7))
    with pytest.raises(SystemExit) as end:
        run_py.main()
    assert end.value.code == 7
    assert seen == [[run_py.python(""), "-m", *ran]]


def test_benchmarks_have_an_environment_of_their_own(run_py: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(run_py.sys, "argv", ["run.py", "bench", "--quick"])
    monkeypatch.setattr(run_py, "make_environment", lambda extras: seen.append([extras]))
    seen: list[list[str]] = []
    monkeypatch.setattr(run_py.subprocess, "call", recording(seen, 0))
    with pytest.raises(SystemExit):
        run_py.main()
    bench = Path(run_py.ROOT, ".venv-bench", "bin", "python")
    assert seen == [["[bench]"], [str(bench), str(Path("bench", "performance.py")), "--quick"]]


def test_an_environment_that_starts_it_is_never_cleared(run_py: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    keep = Path(run_py.VENV) / "keep"
    keep.parent.mkdir()
    keep.touch()
    monkeypatch.setattr(run_py.sys, "prefix", run_py.VENV)
    monkeypatch.setattr(run_py.subprocess, "call", lambda *_, **__: pytest.fail("nothing is to be installed"))
    run_py.make_environment("[dev]")
    assert keep.exists()
