"""Studies: what made the pages of results in `docs/`. Each runs from a checkout, as `python -m
studies NAME`.
"""
