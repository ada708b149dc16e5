"""Modes as plain data: synthesized FRFs, matching, measurement effects, edits by the operator."""
