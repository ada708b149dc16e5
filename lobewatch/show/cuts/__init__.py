"""What a cut sounded like, for people: sentences, JSON, a picture."""
