"""Settings of Sphinx for the documentation site, which make_site.py builds."""

import re
from importlib import metadata
from typing import Any

project = "lobewatch"
release = metadata.version("lobewatch")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"
default_role = "code"
html_theme = "furo"
html_title = "lobewatch"
html_show_sourcelink = False
html_show_copyright = False
html_copy_source = False
html_show_search_summary = False  # it would need a server
myst_heading_anchors = 4
myst_links_external_new_tab = True
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_numpy_docstring = True
napoleon_google_docstring = False


def setup(app: Any) -> None:
    """Show texts of fields as they are written: not as "type: description", and |H| not as a substitution."""
    written = dict[str, list[str]]()

    def keep(_app: Any, _what: str, name: str, *arguments: Any) -> None:
        written[name] = list(arguments[-1])

    def restore(_app: Any, what: str, name: str, *arguments: Any) -> None:
        lines = arguments[-1]
        if what in ("attribute", "property", "data") and not any(line.startswith("---") for line in written[name]):
            lines[:] = written[name]
        lines[:] = [re.sub(r"(`[^`]*`)|\|", lambda match: match[1] or r"\|", line) for line in lines]

    app.connect("autodoc-process-docstring", keep, priority=400)
    app.connect("autodoc-process-docstring", restore, priority=600)
