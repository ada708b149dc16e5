"""How a series of tap tests decays: points, alarm, forecast; arrays in, records out."""
