"""The application: tap tests through the whole pipeline, their history, reports and the command line."""
