"""Documented failings of engines, with causes and upper bounds."""
