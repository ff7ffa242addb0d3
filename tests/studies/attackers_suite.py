"""A tiny suite for the commands that compare attackers."""

SUITE = """
games = 2
attacks = ["bad-mouthing", "ballot-stuffing"]
methods = ["scripted"]

[scenarios.small]
preset = "market"

[scenarios.small.set]
max_cycles = 6
agents = [{ role = "SR", count = 4, noise = 0.05 }, { role = "SP", count = 3, ability = [0.3, 1.0] }]

[tracks.honest]

[tracks.raters]
roles = ["SR"]
shares = [0.5]
"""  # noqa: E501


def condition(folder):
    """Write the suite, and return the options of its condition, with few games in one process."""
    path = folder / "tiny.toml"
    path.write_text(SUITE)
    chosen = "--suite", str(path), "--scenario", "small", "--track", "raters", "--share", "0.5"
    return [*chosen, "--games", "6", "--workers", "1"]
