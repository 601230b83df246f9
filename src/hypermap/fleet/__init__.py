"""Beyond one machine: many recordings, many robots, one store."""
