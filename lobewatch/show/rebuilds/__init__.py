"""Rebuilt machines for people: what was mended, and how far it is."""
