"""Panels of judges that vote on items, and agents that judge one another: weights, verdicts and
bought judges.
"""
