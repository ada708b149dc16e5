"""One module a format that other programs read: an FRF, or hits, as a file of it."""
