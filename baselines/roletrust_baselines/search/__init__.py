"""Search methods over the parameters that attacks declare."""

from roletrust_baselines.search.searchers import CmaEs, Grid, PaperAttacks, RandomSearch

__all__ = ["CmaEs", "Grid", "PaperAttacks", "RandomSearch"]
