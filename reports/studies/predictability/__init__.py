"""Study `predictability`."""
