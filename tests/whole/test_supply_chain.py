"""Advisories, SBOM, release check and citation agree with the locks and the changelog."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[2]
SUPPLY_CHAIN_FILES = (
    ".ci/supply_chain.py",
    ".ci/release.py",
    ".ci/advisories.toml",
    "pyproject.toml",
    "examples/own_driver/pyproject.toml",
    "requirements.lock",
    "requirements-dev.lock",
    "requirements-bench.lock",
    "sbom.cdx.json",
    "CHANGELOG.md",
    "CITATION.cff",
)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return a copy of the files that the two scripts read."""
    for name in SUPPLY_CHAIN_FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def run(tree: Path, script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(tree / ".ci" / script), *arguments]
    return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)


def replace(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_no_locked_and_no_allowed_version_has_a_known_vulnerability(tree: Path) -> None:
    done = run(tree, "supply_chain.py", "advisories")
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("file", "old", "new", "number"),
    [
        ("requirements.lock", "jinja2==3.1.6", "jinja2==3.1.5", "CVE-2025-27516"),
        ("pyproject.toml", "setuptools>=78.1.1", "setuptools>=68", "CVE-2025-47273"),
        ("examples/own_driver/pyproject.toml", "setuptools>=78.1.1", "setuptools", "CVE-2024-6345"),
    ],
)
def test_a_vulnerable_version_is_named(tree: Path, file: str, old: str, new: str, number: str) -> None:
    replace(tree / file, old, new)
    done = run(tree, "supply_chain.py", "advisories")
    assert done.returncode == 1
    assert re.search(rf"^{re.escape(file)}: .*{number}", done.stdout, re.MULTILINE)


def test_the_sbom_is_that_of_the_lock(tree: Path) -> None:
    kept = (tree / "sbom.cdx.json").read_bytes()
    assert run(tree, "supply_chain.py", "sbom").returncode == 0
    assert (tree / "sbom.cdx.json").read_bytes() == kept
    sbom = json.loads(kept)
    assert (sbom["bomFormat"], sbom["specVersion"]) == ("CycloneDX", "1.6")
    pins = re.findall(r"^([a-z][\w.-]*)==([\w.]+)", (tree / "requirements.lock").read_text("utf-8"), re.MULTILINE)
    assert [(part["name"], part["version"]) for part in sbom["components"]] == pins
    references = [sbom["metadata"]["component"]["bom-ref"], *(part["bom-ref"] for part in sbom["components"])]
    assert len(set(references)) == len(references) == len(sbom["dependencies"])
    needed = {other for part in sbom["dependencies"] for other in part["dependsOn"]}
    assert needed == set(references[1:])


def test_a_release_needs_its_tag_its_changelog_and_its_citation(tree: Path) -> None:
    git = ["git", "-c", "user.name=n", "-c", "user.email=e", "-c", "commit.gpgsign=false", "-c", "tag.gpgsign=false"]
    changelog = tree / "CHANGELOG.md"
    unreleased = re.sub(r"(?s)(## \[Unreleased\]\n).*?(?=\n## \[1)", r"\1", changelog.read_text(encoding="utf-8"))
    changelog.write_text(unreleased, encoding="utf-8")
    for command in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "Release"], ["tag", "v1.0.0"]):
        subprocess.run([*git, *command], cwd=tree, check=True)
    assert run(tree, "release.py", "check").returncode == 0
    for file, old, new, fault in (
        ("pyproject.toml", 'version = "1.0.0"', 'version = "1.0.1"', "tag v1.0.1"),
        ("CHANGELOG.md", "## [1.0.0]", "## [0.9.0]", "no line"),
        ("CHANGELOG.md", "## [Unreleased]\n", "## [Unreleased]\n\n### Added\n\n- A thing.\n", "unreleased"),
        ("CITATION.cff", "\nversion: 1.0.0", "\nversion: 0.9.0", "CITATION.cff"),
    ):
        replace(tree / file, old, new)
        done = run(tree, "release.py", "check")
        assert done.returncode == 1
        assert fault in done.stderr
        assert "not committed" in done.stderr
        subprocess.run([*git, "checkout", "-q", file], cwd=tree, check=True)


def test_setuptools_is_new_enough_where_it_is_named() -> None:
    for path in (ROOT / "pyproject.toml", ROOT / "CONTRIBUTING.md", *ROOT.glob("[et]*/*/**/pyproject.toml")):
        for bound in re.findall(r'"setuptools([^."]*[\d.]*)"', path.read_text(encoding="utf-8")):
            assert bound == ">=78.1.1", path


def test_each_advisory_has_its_source_and_does_not_affect_the_version_that_mends_it() -> None:
    for entry in tomllib.loads((ROOT / ".ci" / "advisories.toml").read_text(encoding="utf-8"))["advisory"]:
        assert re.search(r"GHSA-\w{4}-\w{4}-\w{4}|PYSEC-\d{4}-\d+|changelog|CVE record", entry["source"]), entry
        assert not SpecifierSet(entry["affected"]).contains(entry["fixed"]), entry
