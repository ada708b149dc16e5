"""Test cuts: chatter detection in recordings, and learning of the rotating spindle."""
