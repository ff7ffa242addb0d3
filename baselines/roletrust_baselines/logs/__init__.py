"""Trust models on logs of real ratings: what they are compared with, how well they forecast, and
attacks on a log.
"""
