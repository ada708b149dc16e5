"""Verdicts, lobes, advice and doubt of cutting programs for people and as JSON."""
