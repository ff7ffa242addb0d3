"""Search methods over the parameters that attacks declare."""

from roletrust_baselines.search.agreed import AgreedCmaEs
from roletrust_baselines.search.searchers import CmaEs, Grid, PaperAttacks, RandomSearch

__all__ = ["AgreedCmaEs", "CmaEs", "Grid", "PaperAttacks", "RandomSearch"]
