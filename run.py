#!/usr/bin/env python3
"""Start lobewatch from a checkout: the demo, its tests, or any command, in an environment of its own (.venv).

    python3 run.py               the demo
    python3 run.py test [...]    the tests (--long: the long ones too); the rest goes to pytest
    python3 run.py ARGS          lobewatch ARGS

Needs nothing but Python's standard library; runs far enough under an old Python (2.7 too) to say which one is needed.
"""

import hashlib
import os
import shutil
import subprocess
import sys

NEEDED = (3, 11)
ROOT = os.path.dirname(os.path.abspath(__file__))
VENV = os.path.join(ROOT, ".venv")
SCRIPTS = os.path.join(VENV, "Scripts" if os.name == "nt" else "bin")
PYTHON = os.path.join(SCRIPTS, "python.exe" if os.name == "nt" else "python")
LOCKS = {"": "requirements.lock", "[dev]": "requirements-dev.lock"}


def stamp(extras):
    """Digest of all that decides what the environment holds."""
    digest = hashlib.sha256((sys.version + sys.executable + ROOT).encode())
    for name in ("pyproject.toml", "run.py", LOCKS[extras]):
        with open(os.path.join(ROOT, name), "rb") as file:
            digest.update(file.read())
    return digest.hexdigest() + extras


def installer():
    """Command that installs into the environment: pip of this Python, else uv; None where there is neither."""
    pip = [sys.executable, "-m", "pip"]
    if subprocess.call(pip + ["--version"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) == 0:
        return pip + ["--python", PYTHON, "--disable-pip-version-check", "install", "--quiet"]
    uv = shutil.which("uv")
    return [uv, "pip", "install", "--quiet", "--python", PYTHON] if uv else None


def make_environment(extras):
    """Make .venv with the locked packages and lobewatch in it, unless it is there; extras is "" or "[dev]"."""
    if os.path.realpath(sys.prefix) == os.path.realpath(VENV):
        return  # started by the environment itself, which cannot make itself anew
    marker = os.path.join(VENV, "lobewatch-stamp")
    if os.path.exists(marker):
        with open(marker) as file:
            present = file.read()
        if present in (stamp(extras), stamp("[dev]")):
            return
    command = installer()
    if command is None:
        sys.exit(
            "lobewatch needs pip or uv to install its packages: "
            "install one of them (Debian: sudo apt install python3-pip) and start again."
        )
    import venv

    sys.stderr.write("Setting up %s (once; a minute or two) ...\n" % VENV)
    venv.create(VENV, with_pip=False, clear=True)
    locked = ["--require-hashes", "-r", os.path.join(ROOT, LOCKS[extras])]
    steps = [["--upgrade", "pip"], ["--no-deps", "--editable", ROOT]]
    if subprocess.call(command + locked):
        sys.stderr.write("The locked packages do not fit here (see above): taking what pyproject.toml allows.\n")
        steps[1] = ["--editable", ROOT + extras]
    for packages in steps:
        status = subprocess.call(command + packages)
        if status:
            sys.exit("lobewatch could not install its packages (see above); check the network and start again.")
    with open(marker, "w") as file:
        file.write(stamp(extras))


def tests(arguments):
    """Command that runs the tests; all on all cores where none are chosen, with --long their coverage is judged."""
    chosen = [argument for argument in arguments if argument != "--long"]
    whole = [] if chosen else ["-n", "auto", "--dist", "worksteal"]
    every = ["-m", "long or not long", "--timeout", "3600"] if "--long" in arguments else []
    judged = ["--cov"] if every and whole else []
    return [PYTHON, "-m", "pytest"] + whole + every + judged + chosen


def main():
    """Run what the arguments name; the exit status is that of the first command that fails."""
    if sys.version_info < NEEDED:
        sys.exit("lobewatch needs Python %d.%d or newer; this is %s." % (NEEDED + (sys.version.split()[0],)))
    arguments = sys.argv[1:] or ["demo"]
    testing = arguments[0] == "test"
    make_environment("[dev]" if testing else "")
    if testing:
        os.chdir(ROOT)
    command = tests(arguments[1:]) if testing else [PYTHON, "-m", "lobewatch.cli"] + arguments
    try:
        sys.exit(subprocess.call(command))
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
