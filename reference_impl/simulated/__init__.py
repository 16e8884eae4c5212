"""The simulated loop: contacts, impacts, resting contacts, events and integration."""
