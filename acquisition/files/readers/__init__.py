"""Readers of recorded file formats, without interpretation of the contents."""
