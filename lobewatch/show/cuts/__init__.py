"""Show recorded and suggested test cuts."""
