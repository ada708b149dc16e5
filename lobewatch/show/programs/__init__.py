"""Presentation of verdicts, lobes and advice for cutting programs."""
