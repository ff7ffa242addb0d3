"""Trust models in which every rater has its own view. The published trust is the mean of these
views.
"""
