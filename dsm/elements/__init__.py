"""Beam elements as power series, and the nodes between them."""
