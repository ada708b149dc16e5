"""From a stream of scans to single hits, and what a hit is made of: rest, pulse, ringing, window."""

from acquisition.hit import TapInputs, select_input_channels
from acquisition.hits.capture_hits import HitSearch, Trigger, capture_hits, split_record
from acquisition.hits.free_decay import MAX_CONTACT_TIME, estimate_decay_time, extract_free_decay, measure_rest_noise
from acquisition.hits.pulse import Pulse, count_pre_hit_samples, extract_baseline, find_pulse, window_force

__all__ = [
    "MAX_CONTACT_TIME",
    "HitSearch",
    "Pulse",
    "TapInputs",
    "Trigger",
    "capture_hits",
    "count_pre_hit_samples",
    "estimate_decay_time",
    "extract_baseline",
    "extract_free_decay",
    "find_pulse",
    "measure_rest_noise",
    "select_input_channels",
    "split_record",
    "window_force",
]
