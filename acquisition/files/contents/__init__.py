"""Contents of a recorded file, the user's description of it, and the hits or the FRF resolved from both."""
