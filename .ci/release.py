#!/usr/bin/env python3
"""Build a reproducible wheel, and check what a release needs.

.ci/release.py wheel OUT      build the wheel twice, compare both byte by byte, and put it into OUT
.ci/release.py check [ROOT]   exit code 1 if tag, changelog, CITATION.cff and version do not agree
.ci/release.py release OUT    check, build, and write the SBOM and SHA256SUMS
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WHEEL_FILES = ("pyproject.toml", "README.md", "LICENSE")
"""Files of the wheel that are not in its packages."""
EARLIEST_ZIP_TIME = "315532800"
"""1980-01-01, the time of all files of a wheel that is built outside of git (s)."""


def build_wheel(out: Path) -> Path:
    """Build the wheel twice, at two places, with other leftovers and rights, and keep one."""
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(2) as threads:
        trees = [Path(work) / name / "tree" for name in ("first", "second-build")]
        first, second = threads.map(_build_once, trees, (False, True))
        if first.read_bytes() != second.read_bytes():
            sys.exit(f"{first.name}: two builds differ")
        names = {name.split("/")[0] for name in zipfile.ZipFile(first).namelist()}
        info = {name for name in names if name.endswith(".dist-info")}
        if names - info != set(_packages()):
            sys.exit(f"{first.name}: contains {', '.join(sorted(names - info))}, allowed are {', '.join(_packages())}")
        out.mkdir(parents=True, exist_ok=True)
        return Path(shutil.copy(first, out))


def _packages() -> list[str]:
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return sorted(name.rstrip("*") for name in tables["tool"]["setuptools"]["packages"]["find"]["include"])


def _build_once(tree: Path, is_untidy: bool) -> Path:
    """Build the wheel from a copy of its files, also next to the folders of a demo and of an earlier build."""
    for name in _packages():
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in WHEEL_FILES:
        shutil.copy(ROOT / name, tree)
    if is_untidy:
        for folder in ("lobewatch-demo", "build"):
            (tree / folder / "taps").mkdir(parents=True)
            (tree / folder / "machine.toml").write_text("[machine]\n", encoding="utf-8")
    for path in tree.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)
    command = [sys.executable, "-m", "pip", "--quiet", "wheel", "--no-deps", "--wheel-dir", str(tree.parent), "."]
    subprocess.run(command, cwd=tree, check=True, env=os.environ | {"SOURCE_DATE_EPOCH": _commit_time()})
    (wheel,) = tree.parent.glob("*.whl")
    return wheel


def _commit_time() -> str:
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    return given or _git("log", "-1", "--format=%ct") or EARLIEST_ZIP_TIME


def _git(*arguments: str, root: Path = ROOT) -> str:
    return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False).stdout.strip()


def find_faults(root: Path) -> Iterator[str]:
    """Yield a sentence for each thing that a release of this tree lacks."""
    version = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    changelog = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.search(rf"^## \[{re.escape(version)}\] - (\d{{4}}-\d\d-\d\d)$", changelog, re.MULTILINE)
    if not released:
        yield f"CHANGELOG.md has no line '## [{version}] - YYYY-MM-DD'. Move the changes of Unreleased there."
    if re.search(r"^## \[Unreleased\]\s+[^#\s]|^## \[Unreleased\]\s+###", changelog, re.MULTILINE):
        yield "CHANGELOG.md has unreleased changes. Move them to the section of this version."
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    for key, value in (("version", version), ("date-released", released[1] if released else "")):
        if not re.search(rf"^{key}: [\"']?{re.escape(value)}[\"']?$", citation, re.MULTILINE):
            yield f"CITATION.cff has another {key} than {value or 'the changelog'}. Correct CITATION.cff."
    if _git("status", "--porcelain", root=root):
        yield "The tree has changes that are not committed. Commit or remove them."
    if f"v{version}" not in _git("tag", "--points-at", "HEAD", root=root).split():
        yield f"The newest commit has no tag v{version}. Make it with git tag --sign v{version}."


def main() -> None:
    """Run one of the three."""
    task, *rest = sys.argv[1:] or [""]
    if task in ("check", "release"):
        faults = list(find_faults(Path(rest[0]) if task == "check" and rest else ROOT))
        if faults:
            sys.exit("\n".join(faults))
    if task in ("wheel", "release") and len(rest) == 1:
        files = [build_wheel(Path(rest[0]))]
        if task == "release":
            files.append(Path(shutil.copy(ROOT / "sbom.cdx.json", rest[0])))
        sums = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in files]
        print(*sums, sep="", end="")
        if task == "release":
            (Path(rest[0]) / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
    elif task != "check":
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
