"""Defences that learn: a population of attackers and one of trust models, each trained against the
other.
"""
