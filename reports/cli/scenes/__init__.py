"""Commands on scenes in files: which scenes a command plays, their schema, import and export."""
