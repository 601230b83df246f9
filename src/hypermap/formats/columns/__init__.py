"""Columns of values and footprints: as arrays, text and binary."""
