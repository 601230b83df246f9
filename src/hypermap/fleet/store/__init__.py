"""The shared store: the maps of many sites in one PostgreSQL database with PostGIS."""
