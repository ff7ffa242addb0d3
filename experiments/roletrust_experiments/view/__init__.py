"""The page on which a team is watched while it runs. Needs Bokeh."""
