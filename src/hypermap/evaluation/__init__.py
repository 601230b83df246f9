"""How good a map is, measured against another."""
