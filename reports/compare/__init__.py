"""Runs that are stored: compared with each other, and judged again."""
