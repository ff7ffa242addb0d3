"""The site of the project, as far as registries and commands write it: an extension of Sphinx, see `docs/conf.py`."""
