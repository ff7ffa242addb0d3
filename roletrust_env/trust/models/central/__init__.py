"""Trust models that see all ratings, as a manager does."""
