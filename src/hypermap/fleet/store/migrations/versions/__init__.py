"""The steps from an empty database to the tables that this program knows."""
