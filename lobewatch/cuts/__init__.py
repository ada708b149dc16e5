"""What test cuts say: what a recording sounds like, what is learnt of the turning spindle, the next cut."""
