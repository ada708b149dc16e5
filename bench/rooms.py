"""Report the structure of the code: folders and their imports, cycles, sizes, names.

    python bench/rooms.py [--root FOLDER] [--verbose]

A room is a folder with Python files. An arrow goes from a room to the one that defines a name it takes, however many
facades hand that name on, inside functions and for type checking too.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch")
GENERIC = frozenset(
    re.findall(
        r"\w+",
        "found told said one ones known seen made what which how this that these those there then here own some "
        "any each every other others rest both all thing things stuff item items it its mine so ",
    )
)
"""Words that say nothing of what a name holds."""
NO_NOUN = frozenset(
    re.findall(
        r"\w+",
        "of that those these this it its as in by from for to with without at on where when what which who whose "
        "why how if is are was were see like such both each so none below above beside behind before after up down "
        "and or ",
    )
)
"""Words that the docstring of a field does not begin with."""
SMALL = 40
"""Lines below which a file is looked at, whether it belongs to its only user."""


@dataclass(frozen=True)
class Import:
    """A name that a file takes from another."""

    file: str
    """Module that takes it."""
    target: str
    """Module that defines it."""
    name: str
    """The name itself; empty for a whole module."""
    is_hidden: bool
    """True if the import is in a function or only for type checking."""


@cache
def read_house(root: Path) -> House:
    """Return the modules of a checkout, read once in a process."""
    return House(root)


class House:
    """The modules of a checkout."""

    def __init__(self, root: Path, packages: Iterable[str] = PACKAGES) -> None:
        """root: of the checkout."""
        self.paths = {_module(path, root): path for package in packages for path in (root / package).rglob("*.py")}
        self.trees = {name: ast.parse(path.read_text("utf-8")) for name, path in self.paths.items()}
        self._facades = {name: _handed_on(name, path, self.trees[name]) for name, path in self.paths.items()}

    @cached_property
    def imports(self) -> list[Import]:
        """Every name that a module takes from another."""
        return [taken for module in self.paths for taken in self._taken(module) if taken.target != module]

    @property
    def rooms(self) -> list[str]:
        """Folders with modules, as packages."""
        return sorted(name for name, path in self.paths.items() if path.name == "__init__.py")

    def room(self, module: str) -> str:
        """Return the folder of a module as a package; a module next to subfolders counts as a room of its own."""
        folder = module.rpartition(".")[0]
        return module if self.paths[module].name == "__init__.py" or folder in self._with_subfolders else folder

    @cached_property
    def _with_subfolders(self) -> set[str]:
        packages = {name for name, path in self.paths.items() if path.name == "__init__.py"}
        return {name.rpartition(".")[0] for name in packages if "." in name}

    @cached_property
    def arrows(self) -> Mapping[tuple[str, str], list[Import]]:
        """Imports by the two rooms they join; those of facades, which only hand on, are none."""
        joined = defaultdict[tuple[str, str], list[Import]](list)
        for taken in self.imports:
            ends = self.room(taken.file), self.room(taken.target)
            if ends[0] != ends[1] and self.paths[taken.file].name != "__init__.py":
                joined[ends].append(taken)
        return joined

    def circles(self, package: str = "") -> list[list[str]]:
        """Import cycles, largest first; package: only those inside it."""
        return _circles([ends for ends in self.arrows if all(end.startswith(package) for end in ends)])

    def file_circles(self, package: str = "") -> list[list[str]]:
        """Modules that reach each other."""
        inside = [taken for taken in self.imports if self.paths[taken.file].name != "__init__.py"]
        return _circles([(t.file, t.target) for t in inside if t.file.startswith(package)])

    def lines(self, package: str) -> dict[str, int]:
        """Lines of each module of a package."""
        mine = {name: path for name, path in self.paths.items() if name.split(".")[0] == package}
        return {name: len(path.read_text("utf-8").splitlines()) for name, path in mine.items()}

    def users(self, module: str) -> set[str]:
        """Modules that take something from one, but for facades."""
        takes = {taken.file for taken in self.imports if taken.target == module}
        return {name for name in takes if self.paths[name].name != "__init__.py"}

    def generic_names(self, package: str) -> list[str]:
        """Names bound in a package that say nothing of what they hold, as `module:name`."""
        bound = ((module, name) for module in self.lines(package) for name in bound_names(self.trees[module]))
        return [f"{module}:{name}" for module, name in bound if name.strip("_") in GENERIC]

    def share_without_noun(self, package: str) -> float:
        """Share of the docstrings of fields that do not begin with a noun."""
        texts = [text for module in self.lines(package) for _, text in field_docstrings(self.trees[module])]
        return sum(map(begins_without_a_noun, texts)) / max(len(texts), 1)

    @cached_property
    def classes(self) -> Mapping[str, list[str]]:
        """Modules by the names of the classes that they define."""
        where = defaultdict[str, list[str]](list)
        for module, tree in self.trees.items():
            for node in tree.body:
                if isinstance(node, ast.ClassDef):
                    where[node.name].append(module)
        return where

    @staticmethod
    def constants(tree: ast.Module) -> list[str]:
        """Return the names in capitals that a module binds at its top level."""
        bound = (
            node.targets[0] if isinstance(node, ast.Assign) else node.target
            for node in tree.body
            if isinstance(node, ast.Assign | ast.AnnAssign)
        )
        return [node.id for node in bound if isinstance(node, ast.Name) and re.fullmatch(r"_?[A-Z][A-Z0-9_]*", node.id)]

    def _taken(self, module: str) -> Iterator[Import]:
        holders = [node for node in ast.walk(self.trees[module]) if _hides(node)]
        hidden = {id(node) for holder in holders for node in ast.walk(holder)}
        for node in ast.walk(self.trees[module]):
            if isinstance(node, ast.ImportFrom):
                base = _absolute(node, module, self.paths[module])
                for alias in node.names:
                    target = self._definer(base, alias.name)
                    if target is not None:
                        yield Import(module, target, alias.name, id(node) in hidden)
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    if alias.name in self.paths:
                        yield Import(module, alias.name, "", id(node) in hidden)

    def _definer(self, base: str, name: str) -> str | None:
        if f"{base}.{name}" in self.paths:
            return f"{base}.{name}"
        if base not in self.paths:
            return None
        further = self._facades[base].get(name)
        return base if further is None else self._definer(*further)


def _hides(node: ast.AST) -> bool:
    """Return whether imports below a node are not made with its module."""
    is_check = isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    return is_check or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)


def _module(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _absolute(node: ast.ImportFrom, module: str, path: Path) -> str:
    if not node.level:
        return node.module or ""
    base = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    base = base[: len(base) - node.level + 1]
    return ".".join([*base, *([node.module] if node.module else [])])


def _handed_on(module: str, path: Path, tree: ast.Module) -> dict[str, tuple[str, str]]:
    """Names that a module hands on, with where it has them from."""
    stub = path.with_suffix(".pyi")
    top = [*tree.body, *(ast.parse(stub.read_text("utf-8")).body if stub.exists() else [])]
    return {
        alias.asname or alias.name: (_absolute(node, module, path), alias.name)
        for node in top
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if _absolute(node, module, path) != module
    }


def _circles(arrows: Iterable[tuple[str, str]]) -> list[list[str]]:
    """Sets of more than one node that all reach each other, the largest first."""
    follows = defaultdict[str, set[str]](set)
    for start, end in arrows:
        follows[start].add(end)
    reach = {node: _reached(node, follows) for node in sorted(follows)}
    circles = {frozenset(other for other in reach[node] if node in reach.get(other, ())) for node in reach}
    return sorted((sorted(circle) for circle in circles if len(circle) > 1), key=len, reverse=True)


def _reached(start: str, follows: Mapping[str, set[str]]) -> set[str]:
    """All nodes that some arrows lead to from one."""
    reached, ahead = set[str](), [start]
    while ahead:
        fresh = follows.get(ahead.pop(), set()) - reached
        reached |= fresh
        ahead += fresh
    return reached


def bound_names(tree: ast.AST) -> Iterator[str]:
    """Every binding of a name: assigned, looped over, taken as a parameter."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def field_docstrings(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Fields of classes with the docstring below them."""
    for holder in ast.walk(tree):
        if isinstance(holder, ast.ClassDef):
            for field, after in zip(holder.body, holder.body[1:], strict=False):
                if (
                    isinstance(field, ast.AnnAssign)
                    and isinstance(field.target, ast.Name)
                    and isinstance(after, ast.Expr)
                    and isinstance(after.value, ast.Constant)
                    and isinstance(after.value.value, str)
                ):
                    yield f"{holder.name}.{field.target.id}", after.value.value


def begins_without_a_noun(docstring: str) -> bool:
    """Return whether a docstring begins with a word that no noun phrase begins with."""
    word = re.match(r"\W*([A-Za-z]+)", docstring)
    return docstring.startswith("...") or (word is not None and word[1].lower() in NO_NOUN)


HEADINGS = (
    "package",
    "rooms",
    "circles of rooms",
    "of files",
    "files",
    "lines",
    "below 50 lines",
    "generic names / 1000 lines",
    "field docstrings without a noun (%)",
)


def figures(house: House, package: str) -> tuple[object, ...]:
    """One line of the table."""
    lines = house.lines(package)
    total = sum(lines.values())
    return (
        package,
        sum(room.split(".")[0] == package for room in house.rooms),
        ", ".join(str(len(circle)) for circle in house.circles(package)) or "0",
        ", ".join(str(len(circle)) for circle in house.file_circles(package)) or "0",
        len(lines),
        total,
        sum(count < 50 for count in lines.values()),
        f"{1000 * len(house.generic_names(package)) / total:.0f}",
        f"{100 * house.share_without_noun(package):.0f}",
    )


def report(house: House, verbose: bool) -> None:
    """Print the table."""
    print("|", *" | ".join(HEADINGS).splitlines(), "|")
    print("|" + "---|" * len(HEADINGS))
    for package in PACKAGES:
        print("|", " | ".join(map(str, figures(house, package))), "|")
    named = house.classes
    ambiguous = {name: modules for name, modules in named.items() if len(modules) > 1}
    print(f"\nClass names: {len(named)}, with two meanings: {len(ambiguous)}")
    for name, modules in ambiguous.items() if verbose else ():
        print(" ", name, *modules)
    for circle in house.circles() if verbose else ():
        print("circle:", *circle)
        for (start, end), imports in sorted(house.arrows.items()):
            if {start, end} <= set(circle):
                print(f"  {start} -> {end}", *(f"\n      {one.file}: {one.name} of {one.target}" for one in imports))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1])
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    report(House(arguments.root), arguments.verbose)
