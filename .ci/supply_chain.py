#!/usr/bin/env python3
"""Check locked packages against advisories, and list them as CycloneDX (SBOM). Nothing is downloaded.

.ci/supply_chain.py advisories    exit code 1 if a locked or an allowed version has a known vulnerability
.ci/supply_chain.py sbom          write sbom.cdx.json for requirements.lock (.ci/lock does it)
"""

import hashlib
import json
import re
import subprocess
import sys
import time
import tomllib
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ("requirements.lock", "requirements-dev.lock", "requirements-bench.lock")
BUILD_REQUIREMENTS = ("pyproject.toml", "examples/own_driver/pyproject.toml")
"""Files that name the packages of a build."""
OLD_LOCK_DAYS = 90
"""Age of a lock from which a note asks to renew it (days), chosen."""
SECONDS_PER_DAY = 86400


class Pin(NamedTuple):
    """Locked package."""

    name: str
    version: str
    marker: str
    """Environment of this version, empty for every one."""
    required_by: tuple[str, ...]
    """Packages that need it."""

    @property
    def url(self) -> str:
        """Package URL (purl), without a registry."""
        return f"pkg:pypi/{self.name}@{self.version}"


def read_lock(path: Path) -> list[Pin]:
    """Read the pins of a lock."""
    pins = []
    for entry in re.split(r"^(?=\w)", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        head, _, rest = entry.partition("\\\n")
        requirement, _, marker = head.partition(";")
        name, _, version = requirement.strip().partition("==")
        required_by = re.findall(r"^    #(?: via|  ) +([\w.-]+)", rest, re.MULTILINE)
        pins.append(Pin(name, version, marker.strip(), tuple(required_by)))
    return pins


def find_advisories(root: Path) -> Iterator[str]:
    """Yield a sentence for each locked version and each lower bound with a known vulnerability."""
    from packaging.requirements import Requirement
    from packaging.specifiers import SpecifierSet
    from packaging.utils import canonicalize_name
    from packaging.version import Version

    text = (root / ".ci" / "advisories.toml").read_text(encoding="utf-8")
    known = [(entry["package"], SpecifierSet(entry["affected"]), entry) for entry in tomllib.loads(text)["advisory"]]
    used = [(lock, pin.name, pin.version) for lock in LOCKS for pin in read_lock(root / lock)]
    for file in BUILD_REQUIREMENTS:
        tables = tomllib.loads((root / file).read_text(encoding="utf-8"))
        lines = tables["build-system"]["requires"] + tables["project"].get("dependencies", [])
        for requirement in map(Requirement, lines):
            lowest = [bound.version for bound in requirement.specifier if bound.operator in (">=", "==")]
            used += [(file, canonicalize_name(requirement.name), version) for version in lowest or ["0"]]
    for place, name, version in used:
        for package, affected, entry in known:
            if package == name and affected.contains(Version(version), prereleases=True):
                yield f"{place}: {name} {version} has {entry['id']} ({entry['title']}). Take {entry['fixed']} or newer."


def find_old_locks(root: Path) -> Iterator[str]:
    """Yield a note for each lock that nobody has renewed for long, by the date of its last commit."""
    for lock in LOCKS:
        command = ["git", "log", "-1", "--format=%ct", "--", lock]
        dated = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False).stdout.strip()
        days = (time.time() - float(dated)) / SECONDS_PER_DAY if dated else 0.0
        if days > OLD_LOCK_DAYS:
            yield f"note: {lock} is {days:.0f} days old. Renew it with .ci/lock --upgrade."


def build_sbom(root: Path) -> dict[str, Any]:
    """Build the SBOM of requirements.lock as CycloneDX 1.6; the same lock gives the same bytes."""
    lock = root / LOCKS[0]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    own = {
        "type": "application",
        "bom-ref": f"pkg:pypi/{project['name']}@{project['version']}",
        "name": project["name"],
        "version": project["version"],
        "description": project["description"],
        "licenses": [{"license": {"id": project["license"]}}],
        "purl": f"pkg:pypi/{project['name']}@{project['version']}",
    }
    pins, content = read_lock(lock), lock.read_bytes() + project["version"].encode()
    owners = [(project["name"], own["purl"]), *((pin.name, pin.url) for pin in pins)]
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.UUID(hashlib.sha256(content).hexdigest()[:32], version=4)}",
        "version": 1,
        "metadata": {"component": own},
        "components": [_build_component(pin) for pin in pins],
        "dependencies": [
            {"ref": url, "dependsOn": [pin.url for pin in pins if name in pin.required_by]} for name, url in owners
        ],
    }


def _build_component(pin: Pin) -> dict[str, Any]:
    component: dict[str, Any] = {"type": "library", "bom-ref": pin.url, "name": pin.name, "version": pin.version}
    component |= {"scope": "required", "purl": pin.url}
    return component | ({"properties": [{"name": "python:marker", "value": pin.marker}]} if pin.marker else {})


def main() -> None:
    """Run one of the two."""
    if sys.argv[1:] == ["sbom"]:
        text = json.dumps(build_sbom(ROOT), indent=1)
        (ROOT / "sbom.cdx.json").write_text(f"{text}\n", encoding="utf-8")
    elif sys.argv[1:] == ["advisories"]:
        faults = list(find_advisories(ROOT))
        print(*faults, *find_old_locks(ROOT), f"advisories: {len(faults)} of locked packages", sep="\n")
        sys.exit(bool(faults))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
