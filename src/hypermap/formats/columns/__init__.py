"""Columns of values and outlines in bulk: as arrays, text and binary."""
