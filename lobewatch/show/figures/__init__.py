"""Figures: trend, modes, spindle model, stability lobes."""
