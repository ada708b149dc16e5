"""How a machine stands, told to those who are not looking: other programs, and the next who asks."""
