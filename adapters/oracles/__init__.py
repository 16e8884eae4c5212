"""Independent second opinions: what no engine says about itself."""
