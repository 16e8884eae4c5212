"""The simulated loop: contacts, impacts, resting contacts, events, integration and separation."""
