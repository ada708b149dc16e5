"""Whether a hit is good."""

from acquisition.hit_quality.evaluate_hit import HitVerdict, average_good_hits, check_hit, evaluate_hit

__all__ = [
    "HitVerdict",
    "average_good_hits",
    "check_hit",
    "evaluate_hit",
]
