"""The locks hold what pyproject.toml asks for: exact versions with hashes, and no address of any index."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[2]
LOCKS = {"requirements.lock": "", "requirements-dev.lock": "dev", "requirements-bench.lock": "bench"}
"""Extras by locks."""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def entries(lock: str) -> list[tuple[Requirement, str]]:
    """Each locked package, and what follows it up to the next."""
    text = (ROOT / lock).read_text(encoding="utf-8")
    found = re.findall(r"^([a-z].*?) \\$\n((?: .*\n)+)", text, re.MULTILINE)
    assert len(found) == len(re.findall(r"^\w", text, re.MULTILINE))
    return [(Requirement(line), rest) for line, rest in found]


def locked(lock: str) -> dict[str, set[Version]]:
    """Versions by name; several where they depend on the Python."""
    versions: dict[str, set[Version]] = {}
    for requirement, _ in entries(lock):
        (pin,) = requirement.specifier
        assert pin.operator == "==", requirement
        versions.setdefault(canonicalize_name(requirement.name), set()).add(Version(pin.version))
    return versions


@pytest.mark.parametrize("lock", LOCKS)
def test_every_dependency_is_locked_to_a_version_that_it_allows(lock: str) -> None:
    wanted = PROJECT["dependencies"] + PROJECT["optional-dependencies"].get(LOCKS[lock], [])
    versions = locked(lock)
    for requirement in map(Requirement, wanted):
        found = versions.get(canonicalize_name(requirement.name))
        assert found, f"{requirement.name} is not in {lock}; run .ci/lock"
        assert all(version in requirement.specifier for version in found), (requirement, found)


def test_what_runs_is_what_is_tested() -> None:
    runtime, *others = (locked(lock) for lock in LOCKS)
    for other in others:
        assert runtime == {name: other[name] for name in runtime}


@pytest.mark.parametrize("lock", LOCKS)
def test_every_entry_has_hashes(lock: str) -> None:
    for requirement, rest in entries(lock):
        assert re.search(r"--hash=sha256:[0-9a-f]{64}\b", rest), requirement


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_names_no_address_and_no_path(lock: str) -> None:
    for line in (ROOT / lock).read_text(encoding="utf-8").splitlines():
        assert "://" not in line
        assert "@" not in line
        assert not re.search(r"(^|[\s=])(/|~|[A-Za-z]:\\|--?(index|extra-index|find-links|trusted))", line), line
