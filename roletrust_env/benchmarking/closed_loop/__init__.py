"""Benchmark of the closed loop: consumers choose by their trust, receive, remember and report.

A cell is one trust model under one setting and one way to attack. It plays worlds that are drawn
from a distribution: some of them choose the worst attack, others measure it.
"""
