"""One module a format: what stands in a file of it, without deciding what that means."""
