"""Run fragile code in a subprocess with limits on time and memory."""

import atexit
import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

if os.name != "nt":
    import resource

SUBPROCESS_TIMEOUT = 60.0
"""Longest time of a subprocess (s)."""


def run_in_subprocess(
    module: str, *arguments: str, patience: float = SUBPROCESS_TIMEOUT, content: bytes | bytearray | None = None
) -> bytes:
    """Run a module in a subprocess with the same import path and `content` as input, and return its standard output.

    Raises subprocess.SubprocessError where it fails, crashes or takes longer than `patience` (s).
    """
    return subprocess.run(
        _make_command(module, *arguments),
        env=_make_environment(),
        input=content,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        timeout=patience,
        check=True,
    ).stdout


class SubprocessService:
    """Subprocess that works on one request after another, because its start takes longer than most of them.

    Its module calls `read_requests`. After a crash the next request starts it again.
    """

    def __init__(self, module: str) -> None:
        self._module = module
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def request(self, argument: str, patience: float = SUBPROCESS_TIMEOUT) -> None:
        """Wait until the subprocess has worked on an argument.

        Raises subprocess.SubprocessError where it crashes or takes longer than `patience` (s).
        """
        with self._lock:
            if self._process is None:
                self._process = subprocess.Popen(
                    _make_command(self._module),
                    env=_make_environment(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                )
                atexit.register(self.close)
            is_answered = False
            try:
                is_answered = _exchange_line(self._process, argument, patience)
            finally:
                if not is_answered:  # also after Ctrl-C: a late answer must not count for the next request
                    self.close()
            if not is_answered:
                raise subprocess.SubprocessError(f"{self._module} crashed or took too long")

    def close(self) -> None:
        """End the subprocess."""
        process, self._process = self._process, None
        atexit.unregister(self.close)
        if process is not None:
            process.kill()
            process.communicate()


def _exchange_line(process: subprocess.Popen[bytes], argument: str, patience: float) -> bool:
    """Send an argument as a line and wait for the line that answers it. False without one."""
    assert process.stdin is not None
    assert process.stdout is not None
    watch = threading.Timer(patience, process.kill)
    watch.start()
    try:
        process.stdin.write(json.dumps(argument).encode() + b"\n")
        process.stdin.flush()
        return process.stdout.readline() != b""
    except OSError:
        return False
    finally:
        watch.cancel()


def read_requests() -> Iterator[str]:
    """Yield the arguments that a `SubprocessService` sends, and answer each after the work on it."""
    for line in sys.stdin:
        yield json.loads(line)
        sys.stdout.write("\n")
        sys.stdout.flush()


def _make_command(module: str, *arguments: str) -> list[str]:
    return [sys.executable, "-P", "-Wignore", "-m", module, *arguments]


def _make_environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


def limit_resources(seconds: float, memory: float) -> None:
    """Limit processor time (s) and additional memory (bytes) of this process from now on, and write no core dumps.

    Beyond the memory MemoryError is raised. Windows has none of these limits, macOS has none of memory.
    """
    if os.name == "nt":
        return
    _lower_limit(resource.RLIMIT_CORE, 0)
    _lower_limit(resource.RLIMIT_CPU, time.process_time() + seconds)
    sizes = Path("/proc/self/statm")
    if sizes.exists():
        taken = int(sizes.read_text("ascii").split()[0]) * resource.getpagesize()
        _lower_limit(resource.RLIMIT_AS, taken + memory)


def _lower_limit(limit: int, value: float) -> None:
    highest = resource.getrlimit(limit)[1]
    wanted = math.ceil(value)
    resource.setrlimit(limit, (wanted if highest == resource.RLIM_INFINITY else min(wanted, highest), highest))
