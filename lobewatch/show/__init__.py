"""Show results to people and programs: texts, tables, figures, reports, and JSON."""
