"""The map server: a node that serves a map."""
