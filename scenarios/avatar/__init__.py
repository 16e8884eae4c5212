"""Persons and hands: links, chains, postures, kinematics and trackers."""
