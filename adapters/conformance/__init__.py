"""Whether an engine's adapter meets the contract: small scenes with known outcomes, and faults in words."""
