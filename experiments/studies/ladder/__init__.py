"""The ladder of attacks: the rows of its table."""
