#!/usr/bin/env python3
"""Start lobewatch from a checkout: the demo, its tests, or any command, in its own environment (.venv).

    python3 run.py               the demo
    python3 run.py test [...]    the tests (--long: also the long ones), with further options of pytest
    python3 run.py docs          build the documentation site in build/docs and open it
    python3 run.py bench         the benchmarks, in an environment with other packages (.venv-bench)
    python3 run.py ARGS          lobewatch ARGS

Needs only Python's standard library. Under an old Python (also 2.7) it says which version is needed.
"""

import hashlib
import os
import shutil
import subprocess
import sys

NEEDED = (3, 11)
ROOT = os.path.dirname(os.path.abspath(__file__))
VENV = os.path.join(ROOT, ".venv")
LOCKS = {"": "requirements.lock", "[dev]": "requirements-dev.lock", "[bench]": "requirements-bench.lock"}


def place(extras):
    """Folder of the environment. The benchmarks have their own."""
    return VENV + "-bench" if extras == "[bench]" else VENV


def python(extras):
    """Python of the environment."""
    return os.path.join(place(extras), *(("Scripts", "python.exe") if os.name == "nt" else ("bin", "python")))


def stamp(extras):
    """Digest of everything that determines the environment."""
    digest = hashlib.sha256((sys.version + sys.executable + ROOT).encode())
    for name in ("pyproject.toml", "run.py", LOCKS[extras]):
        with open(os.path.join(ROOT, name), "rb") as file:
            digest.update(file.read())
    return digest.hexdigest() + extras


def installer(extras):
    """Command that installs into the environment: pip of this Python, else uv. None without both."""
    pip = [sys.executable, "-m", "pip"]
    if subprocess.call(pip + ["--version"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) == 0:
        return pip + ["--python", python(extras), "--disable-pip-version-check", "install", "--quiet"]
    uv = shutil.which("uv")
    return [uv, "pip", "install", "--quiet", "--python", python(extras)] if uv else None


def make_environment(extras):
    """Make the environment with the locked packages and lobewatch, unless it exists. extras: a key of LOCKS."""
    folder = place(extras)
    if os.path.realpath(sys.prefix) == os.path.realpath(folder):
        return  # started by the environment itself, which cannot replace itself
    marker = os.path.join(folder, "lobewatch-stamp")
    if os.path.exists(marker):
        with open(marker) as file:
            present = file.read()
        if present in (stamp(extras), stamp("[dev]")):
            return
    command = installer(extras)
    if command is None:
        sys.exit(
            "lobewatch needs pip or uv to install its packages. "
            "Install one of them (Debian: sudo apt install python3-pip) and start again."
        )
    import venv

    sys.stderr.write("Setting up %s (once, takes a minute or two) ...\n" % folder)
    venv.create(folder, with_pip=False, clear=True)
    locked = ["--require-hashes", "--no-deps", "-r", os.path.join(ROOT, LOCKS[extras])]
    steps = [["--upgrade", "--no-compile", "pip"], ["--no-deps", "--editable", ROOT]]
    if subprocess.call(command + locked):
        sys.stderr.write("The locked packages do not fit this computer (see above). Using pyproject.toml instead.\n")
        steps[1] = ["--editable", ROOT + extras]
    for packages in steps:
        status = subprocess.call(command + packages)
        if status:
            sys.exit("lobewatch could not install its packages (see above). Check the network and start again.")
    with open(marker, "w") as file:
        file.write(stamp(extras))


def tests(arguments):
    """Command that runs the tests: without a choice all of them on all cores, with --long also their coverage."""
    chosen = [argument for argument in arguments if argument != "--long"]
    whole = [] if chosen else ["-n", "auto", "--dist", "worksteal"]
    every = ["-m", "long or not long", "--timeout", "3600"] if "--long" in arguments else []
    judged = ["--cov"] if every and whole else []
    return [python("[dev]"), "-m", "pytest"] + whole + every + judged + chosen


def main():
    """Run the command in the arguments. The exit status is that of the first command that fails."""
    if sys.version_info < NEEDED:
        sys.exit("lobewatch needs Python %d.%d or newer. This is %s." % (NEEDED + (sys.version.split()[0],)))
    arguments = sys.argv[1:] or ["demo"]
    extras = {"test": "[dev]", "docs": "[dev]", "bench": "[bench]"}.get(arguments[0], "")
    make_environment(extras)
    if extras:
        os.chdir(ROOT)
    script = {"docs": os.path.join("docs", "make_site.py"), "bench": os.path.join("bench", "performance.py")}
    if arguments[0] == "test":
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the tests have a process on each core
        command = tests(arguments[1:])
    elif extras:
        command = [python(extras), script[arguments[0]]] + arguments[1:]
    else:
        command = [python(extras), "-m", "lobewatch.cli"] + arguments
    try:
        sys.exit(subprocess.call(command))
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
