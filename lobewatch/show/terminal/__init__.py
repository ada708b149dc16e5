"""Terminal output, setup dialogue, and the tap test screen in characters."""
