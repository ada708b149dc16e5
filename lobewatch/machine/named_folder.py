"""The folder that a command or a program is given by its name."""

from __future__ import annotations

from pathlib import Path


def named_folder(name: Path | str) -> Path:
    """The path; FileNotFoundError for an empty name, which Python takes for the current folder: mostly a slip."""
    if not str(name):
        raise FileNotFoundError("the name of the folder is empty; give the machine folder, or . for the current one")
    return Path(name)
