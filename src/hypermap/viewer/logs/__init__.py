"""Maps, and how they are made, for programs that people already look at their data with."""
