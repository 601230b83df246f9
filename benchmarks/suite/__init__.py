"""Ours and its peers, side by side: what `hypermap bench` runs."""
