"""Scenes in files: TOML, JSON, or Python functions marked `@scene`."""
