"""Show verdicts, lobes and advice for cutting programs."""
