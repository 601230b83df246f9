"""Very many values at once: columns and outlines, as arrays, as text and as binary."""
