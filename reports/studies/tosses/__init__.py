"""The study `reality tosses`: measured tosses of a box, played by every engine from their measured start."""
