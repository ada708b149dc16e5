"""Chatter detection: cuts in a recording, true spindle speed, and verdict; arrays in, records out."""
