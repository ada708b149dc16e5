"""What is said of files that nothing else has a word for."""

from acquisition import Remark


def damaged(about: str, text: str, cure: str = "") -> Remark:
    """Of a file that is missing or not as it was written."""
    return Remark("file-damaged", about, text, cure)


def set_aside(about: str, text: str, cure: str) -> Remark:
    """Of a file that harms nothing."""
    return Remark("set-aside", about, text, cure)
