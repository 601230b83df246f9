"""Observations become layers."""
