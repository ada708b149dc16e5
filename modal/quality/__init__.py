"""How good fitted modes are: whether to believe them, and what the fit did not see."""
