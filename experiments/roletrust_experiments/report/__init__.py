"""The report of a benchmark: one HTML file to look at, and beside it the same numbers and pictures as files."""
