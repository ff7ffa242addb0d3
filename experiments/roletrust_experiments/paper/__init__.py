"""The paper's two figures: who attacks, what is claimed, and whether a run shows it."""
