"""The project's own campaign: faults, hostile input and long runs, against the whole program."""
