"""history.rows: what it still holds, what is to be added, and its place on the disk."""
