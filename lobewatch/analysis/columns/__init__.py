"""The columns of history.h5."""
