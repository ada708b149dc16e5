"""docs/api/ from the docstrings, by pdoc: `.venv/bin/python docs/make_api.py`."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import pdoc.doc
import pdoc.doc_ast
import pdoc.doc_types
import pdoc.render

ROOMS = ("fleet", "history", "logbook", "machine", "measurement", "monitoring", "tool", "verdicts")
MODULES = ("acquisition", "modal", "dsm", "lobes", "lobewatch", *(f"lobewatch.{room}" for room in ROOMS))
"""Modules with a page: the packages, and the folders of lobewatch whose names an `__init__.pyi` gives."""


TEMPLATES = Path(__file__).with_name("templates")


class Annotation(str):
    """A type as it stands in the source, public names with their package: the same on every Python, and linked."""

    __slots__ = ()
    __repr__ = str.__str__


def public_names() -> dict[str, str]:
    """Package and name of each public name."""
    return {name: f"{module}.{name}" for module in reversed(MODULES) for name in import_module(module).__all__}


def pages() -> dict[str, str]:
    """HTML of each page by its path in docs/api."""
    _annotate_as_written(public_names())  # first: pdoc reads types of the stub files as soon as it lists a module
    modules = {name: _with_constants(pdoc.doc.Module(_resolved(name))) for name in MODULES}
    pdoc.render.configure(docformat="numpy", show_source=False, search=False, template_directory=TEMPLATES)
    made = {f"{name.replace('.', '/')}.html": pdoc.render.html_module(modules[name], modules) for name in modules}
    made["index.html"] = pdoc.render.html_index(modules)
    made["style.css"] = pdoc.render.env.get_template("style.css.jinja2").render()
    return {path: _without_indentation(_without_heading_ids(text)) for path, text in made.items()}


def _without_heading_ids(html: str) -> str:
    """Remove the ids of numpydoc sections, as "parameters" would be the id of hundreds of headings."""
    return re.sub(r'<h6 id="[^"]*">', "<h6>", html)


def _without_indentation(html: str) -> str:
    parts = re.split(r"(<pre.*?</pre>)", html, flags=re.DOTALL)
    return "".join(part if place % 2 else re.sub(r"\s*\n\s*", "\n", part) for place, part in enumerate(parts)) + "\n"


def _resolved(name: str) -> Any:
    """Import a package and load all its lazy names."""
    module = import_module(name)
    for public in module.__all__:
        setattr(module, public, getattr(module, public))
    return module


def _with_constants(module: pdoc.doc.Module) -> pdoc.doc.Module:
    """Copy to the constants of a package the docstrings from the modules that bind them."""
    rooms = [room for name, room in sorted(sys.modules.items()) if name.startswith(module.modulename)]
    for constant in module.variables:
        value = vars(module.obj)[constant.name]
        homes = (room for room in rooms if vars(room).get(constant.name) is value)
        texts = (pdoc.doc_ast.walk_tree(home).var_docstrings.get(constant.name, "") for home in homes)
        constant.docstring = next(filter(None, texts), "")
    return module


def _annotate_as_written(qualified: Mapping[str, str]) -> None:
    def full(name: re.Match[str]) -> str:
        return qualified.get(name[0], name[0])

    def written(annotation: Any, *_: Any) -> Any:
        is_text = isinstance(annotation, str)
        return Annotation(re.sub(r"(?<![\w.'\"])[A-Za-z_]\w*", full, annotation)) if is_text else annotation

    for module in (pdoc.doc, pdoc.doc_types):
        module.safe_eval_type = written  # type: ignore[attr-defined]


def write(folder: Path) -> None:
    """Write all pages into a folder, which is made where it is not there."""
    for path, html in pages().items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(html, encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("api"))
