"""Receptance and static stiffness, and tools coupled to them."""
