"""Study `calibration`."""
