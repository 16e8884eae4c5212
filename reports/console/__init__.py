"""Output on terminals of any width."""
