"""Run fragile code in a subprocess with limits on time and memory."""

import math
import os
import subprocess
import sys
import time
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
    command = [sys.executable, "-P", "-Wignore", "-m", module, *arguments]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        command,
        env=environment,
        input=content,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        timeout=patience,
        check=True,
    ).stdout


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
