"""Real ratings: logs that the user brings, streams of ratings, and what can be measured on them."""

from roletrust_env.data.columns import Columns
from roletrust_env.data.dialect import Dialect
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.data.stream import TrustStream

__all__ = ["Columns", "Dialect", "RatingLog", "TrustStream", "read_ratings"]
