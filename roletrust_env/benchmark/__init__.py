"""The robustness benchmark: suites, their cells, how these are played, kept and ranked."""
