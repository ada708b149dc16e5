"""Presentation of results: texts, tables, figures, reports and JSON."""
