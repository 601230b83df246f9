"""Access rules of the servers: under which host names, and from which websites."""
