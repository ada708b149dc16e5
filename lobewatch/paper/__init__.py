"""Comparison with the paper of Gaber & Hashemi: printed and computed numbers, and their differences."""

from lobewatch.paper.comparison import Claim, Comparison
from lobewatch.paper.study import PaperStudy, study_paper

__all__ = ["Claim", "Comparison", "PaperStudy", "study_paper"]
