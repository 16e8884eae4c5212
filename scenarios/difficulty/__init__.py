"""Families of hard scenes: one kind of difficulty each, at levels from easy to absurd."""
