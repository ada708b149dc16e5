"""Pictures: trend, modes, model, stability lobes, and what they are marked with."""
