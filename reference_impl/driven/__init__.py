"""The driven loop: coupling to the tracker, global penetration depth and overlap removal."""
