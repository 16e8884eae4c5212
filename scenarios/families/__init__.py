"""Families of scenes, one file each; `catalogue.py` collects them."""
