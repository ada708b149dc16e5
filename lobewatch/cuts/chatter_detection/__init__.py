"""Chatter detection: cuts in a recording, true spindle speed, chatter or not; arrays in, a record out."""
