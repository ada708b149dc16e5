"""Whether a hit is good."""

from acquisition.verdicts.average_good import average_good
from acquisition.verdicts.check_hit import check_hit
from acquisition.verdicts.judge_hit import judge_hit
from acquisition.verdicts.verdict import HitVerdict

__all__ = [
    "HitVerdict",
    "average_good",
    "check_hit",
    "judge_hit",
]
