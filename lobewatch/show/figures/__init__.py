"""Plot figures: trend, modes, model, stability lobes."""
