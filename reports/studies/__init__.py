"""Studies: measurements other than runs of scenes, each with a command of its own."""
