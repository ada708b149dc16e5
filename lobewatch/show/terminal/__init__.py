"""Print to the terminal, and run the screen of a tap test in it."""
