"""Show and export many machines at once."""
