"""Assertions on physical invariants, for recordings and for plain arrays of any simulator."""
