"""Results: what is measured, how sure it is, and how it is kept."""
