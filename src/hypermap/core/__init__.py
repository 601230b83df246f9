"""The map itself: layers, frames and queries. Imports only numpy and shapely."""
