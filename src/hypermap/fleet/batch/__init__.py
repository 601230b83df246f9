"""Many recordings at once: what is to be mapped, the runs, and the table of results."""
