"""Child processes in which engines play scenes."""
