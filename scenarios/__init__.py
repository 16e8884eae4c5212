"""What is simulated, as plain data. Knows no engine."""
