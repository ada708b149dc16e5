"""Least-squares fit of a few neighbouring modes in one FRF, or in several FRFs with common poles."""
