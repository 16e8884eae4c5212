"""The study `work-precision`: error over wall time of every engine and setting."""
