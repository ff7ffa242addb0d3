"""Searches over the parameters that attacks declare."""

from baselines.search.scripts import USUAL, Scripts
from baselines.search.searchers import CmaEs, Grid, PaperAttacks, RandomSearch

__all__ = ["USUAL", "CmaEs", "Grid", "PaperAttacks", "RandomSearch", "Scripts"]
