"""Who may ask the servers of this package: by which names, and from which sites."""
