"""Real ratings: logs that the user brings, streams of ratings, and what can be measured on them."""

from roletrust_env.logs.audit import AuditReport, audit
from roletrust_env.logs.compare import Comparison, compare
from roletrust_env.logs.log import Log, read
from roletrust_env.logs.rate import Rated, rate
from roletrust_env.logs.sources import Reading
from roletrust_env.logs.stream import TrustStream
from roletrust_env.logs.synthetic import write_log

__all__ = [
    "AuditReport",
    "Comparison",
    "Log",
    "Rated",
    "Reading",
    "TrustStream",
    "audit",
    "compare",
    "rate",
    "read",
    "write_log",
]
