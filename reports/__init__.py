"""Reads recordings, judges, shows. The top of the stack."""
