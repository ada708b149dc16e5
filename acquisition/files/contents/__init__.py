"""Contents of a recorded file, and the hits or the FRF resolved with the user's description."""
