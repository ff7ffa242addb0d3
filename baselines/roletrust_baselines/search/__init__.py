"""Search methods over the parameters that attacks declare."""

from roletrust_baselines.search.searchers import CmaEs, Grid, PaperAttacks, RandomSearch, agreed_search

__all__ = ["CmaEs", "Grid", "PaperAttacks", "RandomSearch", "agreed_search"]
