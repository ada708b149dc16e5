"""The trend of a series for people: chart of characters, sentence, dates, CSV and JSON."""
