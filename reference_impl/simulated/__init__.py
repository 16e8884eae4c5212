"""Simulated loop: contacts, impacts, resting contacts, events and integration."""
