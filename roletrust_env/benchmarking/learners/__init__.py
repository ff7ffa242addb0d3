"""Benchmark of learners: how strong the attacks are that they find on the attack tasks, and with
which budget.
"""
