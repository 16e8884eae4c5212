"""The driven loop: coupling to the tracker, attraction, overlap removal, and chains that push."""
