"""From a stream of scans to single hits, and what a hit is made of: rest, pulse, ringing, window."""
