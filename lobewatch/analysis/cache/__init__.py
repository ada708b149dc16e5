"""history.h5: what it still holds, what is to be added, and its place on the disk."""
