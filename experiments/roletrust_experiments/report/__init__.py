"""The report of a benchmark: one HTML page, with the same numbers and figures as files."""
