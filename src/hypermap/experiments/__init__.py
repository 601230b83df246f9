"""Experiments that anyone can repeat: simulated drives, mapped by several methods, and compared."""
