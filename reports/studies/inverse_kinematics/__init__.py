"""Study `inverse-kinematics`."""
