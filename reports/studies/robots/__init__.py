"""`touchstone import --check`: robots of folders, compared with their files by independent readers."""
