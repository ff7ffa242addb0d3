"""The technical report: `python -m roletrust_experiments.article`. Its numbers come from the results in `docs/`."""
