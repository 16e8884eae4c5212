"""Independent checks of what engines report about themselves."""
