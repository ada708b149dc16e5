"""Evaluation of hits: double hits, overloads, mains hum."""
