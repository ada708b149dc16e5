"""Whether a DATAQ device answers on an open port."""

from __future__ import annotations

from acquisition.dataq.dialogue import DataqDialogue
from acquisition.errors import DeviceError
from acquisition.ports.serial_link import SerialLink
from acquisition.source import DeviceIdentity


def probe_dataq(link: SerialLink) -> DeviceIdentity | None:
    """Who answers, asked once; None where nobody of this family does."""
    dialogue = DataqDialogue(link, tries=1)
    try:
        dialogue.halt()
        return dialogue.identify().identity
    except DeviceError:
        return None
