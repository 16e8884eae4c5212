"""Generated pages of docs/: commands, lists, tables and pictures of measurements, stills of scenes."""
