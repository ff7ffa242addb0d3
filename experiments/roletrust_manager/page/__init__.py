"""The live page, which shows a running team in a browser. Needs Bokeh."""
