"""Studies: what is measured beside the scenes, each a command of its own."""
