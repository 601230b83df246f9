"""The semantic mapper: a node that maps what a live robot sees."""
