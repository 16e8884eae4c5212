"""Commands about nights."""
