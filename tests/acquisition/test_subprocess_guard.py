"""Programs of their own for what may crash: where they import from, and what ends them."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import pytest

from acquisition.subprocess_guard import SubprocessService, run_in_subprocess


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File of the module `told_apart`, which can be imported."""
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path / "told_apart.py"


def test_what_a_module_prints_comes_back_and_it_gets_its_arguments(program: Path) -> None:
    program.write_text("import sys\nprint(sys.argv[1:], __name__)")
    assert run_in_subprocess("told_apart", "a", "b c") == b"['a', 'b c'] __main__\n"


def test_modules_that_lie_in_the_folder_of_the_user_are_not_taken(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program.write_text("import statistics\nprint(statistics.mean([1, 3]))")
    folder = tmp_path / "recordings"
    folder.mkdir()
    (folder / "statistics.py").write_text("raise SystemExit('not meant to be imported')")
    monkeypatch.chdir(folder)
    assert run_in_subprocess("told_apart") == b"2\n"


def test_one_that_computes_for_longer_than_it_may_is_ended(program: Path) -> None:
    program.write_text(
        "from acquisition.subprocess_guard import limit_resources\nlimit_resources(0.5, 1e9)\nwhile True:\n    pass"
    )
    with pytest.raises(subprocess.CalledProcessError) as ended:
        run_in_subprocess("told_apart")
    assert ended.value.returncode == -signal.SIGXCPU


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux limits the memory of a program")
def test_one_that_takes_more_memory_than_it_may_is_denied_it(program: Path) -> None:
    program.write_text(
        "from acquisition.subprocess_guard import limit_resources\nlimit_resources(60, 200e6)\n"
        "few = bytes(100_000_000)\n"
        "try:\n    bytes(400_000_000)\nexcept MemoryError:\n    print('refused')"
    )
    assert run_in_subprocess("told_apart") == b"refused\n"


def test_one_that_waits_for_ever_is_ended(program: Path) -> None:
    program.write_text("import time\ntime.sleep(600)")
    with pytest.raises(subprocess.TimeoutExpired):
        run_in_subprocess("told_apart", patience=0.5)


def test_a_service_works_on_many_requests_and_starts_again_after_a_crash_or_a_hang(
    program: Path, tmp_path: Path
) -> None:
    program.write_text(
        "import os, time\nfrom pathlib import Path\nfrom acquisition.subprocess_guard import read_requests\n"
        "for name in read_requests():\n"
        "    name == 'crash' and os.abort()\n"
        "    name == 'hang' and time.sleep(600)\n"
        "    Path(name).write_text(str(os.getpid()))\n"
    )
    service, files = SubprocessService("told_apart"), [tmp_path / f"line\nbreak-{number}" for number in range(4)]
    service.request(str(files[0]))
    service.request(str(files[1]))
    for word, patience in (("crash", 60.0), ("hang", 0.3)):
        with pytest.raises(subprocess.SubprocessError):
            service.request(word, patience)
    service.request(str(files[2]))
    service.close()
    first, second, third = (path.read_text() for path in files[:3])
    assert first == second != third
