"""Results for people: texts, tables, figures, report, terminal."""
