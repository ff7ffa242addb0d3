"""The pages of the site that registries and commands write: an extension of Sphinx, see `docs/conf.py`."""
