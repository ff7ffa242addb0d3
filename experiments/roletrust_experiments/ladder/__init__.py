"""The ladder: the rows of its table."""
