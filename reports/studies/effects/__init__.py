"""Study `effects`."""
