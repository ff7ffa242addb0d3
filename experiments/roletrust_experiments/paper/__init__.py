"""The paper's two figures: their attacks, their claims, and the check of a run against them."""
