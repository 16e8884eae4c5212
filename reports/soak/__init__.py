"""Soak: random scenes through the reference for as long as asked, each failure shrunk."""
