"""Groups of sub-commands, one module each; `cli.py` puts them together."""
