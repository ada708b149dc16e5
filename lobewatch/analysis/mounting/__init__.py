"""How a tool was mounted when it was tapped: stick-out and state, which divide its tap tests into series."""
