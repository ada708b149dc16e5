"""Labels and style sheet classes of a machine status."""

from lobewatch.monitoring import StatusLevel

STATUS_LABELS = {
    StatusLevel.ALARM: "✗ ALARM",
    StatusLevel.UNKNOWN: "? UNKNOWN",
    StatusLevel.WARN: "! WARNING",
    StatusLevel.GOOD: "✓ GOOD",
}


def status_name(status: str) -> str:
    """Return the status as people read it."""
    return "warning" if status == StatusLevel.WARN else str(status)


def status_label(light: StatusLevel, is_early: bool = False) -> str:
    """Return the status with its symbol."""
    return "✗ EARLY ALARM" if is_early else STATUS_LABELS[light]


def status_css_class(light: StatusLevel, is_early: bool = False) -> str:
    """Return the class of a status in the style sheet."""
    return "early" if is_early else {StatusLevel.GOOD: "ok", StatusLevel.ALARM: "bad"}.get(light, "doubt")
