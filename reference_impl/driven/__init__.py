"""The driven loop: coupling to the tracker, global depth and removal of overlap."""
