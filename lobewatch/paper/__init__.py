"""Comparison with the paper of Gaber & Hashemi: its numbers, ours from one run, and the reason of each difference."""

from lobewatch.paper.comparison import Claim, Comparison
from lobewatch.paper.study import PaperStudy, study_paper

__all__ = ["Claim", "Comparison", "PaperStudy", "study_paper"]
