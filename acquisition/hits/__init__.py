"""From a stream of scans to single hits, and what a hit is made of: rest, pulse, ringing, window."""

from acquisition.hits.capture_hits import HitSearch, Trigger, capture_hits
from acquisition.hits.free_decay import HIT_ENDS, free_decay, resting_noise
from acquisition.hits.hits_in_record import hits_in_record
from acquisition.hits.pulse import Pulse, baseline, find_pulse, samples_before
from acquisition.hits.ring_down import ring_down
from acquisition.hits.tap_inputs import TapInputs, input_channels
from acquisition.hits.windowed_force import windowed_force

__all__ = [
    "HIT_ENDS",
    "HitSearch",
    "Pulse",
    "TapInputs",
    "Trigger",
    "baseline",
    "capture_hits",
    "find_pulse",
    "free_decay",
    "hits_in_record",
    "input_channels",
    "resting_noise",
    "ring_down",
    "samples_before",
    "windowed_force",
]
