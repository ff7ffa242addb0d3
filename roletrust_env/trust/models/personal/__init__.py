"""Models of one agent's own view, of which every rater has one; what is published is their mean."""
