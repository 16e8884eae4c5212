"""Scripts in an engine's own API that play a scene as its adapter does."""
