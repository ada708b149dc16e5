"""Replays for people: what recorded files would become or have become, and how far it is."""
