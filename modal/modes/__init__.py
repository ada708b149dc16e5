"""Modes as plain data, and what follows from them alone: a synthesised FRF, a common delay, a mode followed."""
