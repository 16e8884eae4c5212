"""Reads recordings, judges them and shows the results. The top layer of the stack."""
