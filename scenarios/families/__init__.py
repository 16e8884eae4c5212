"""One file per family of scenes; `catalogue.py` finds them by itself."""
