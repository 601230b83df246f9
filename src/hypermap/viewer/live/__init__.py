"""The page in the browser: a server that shows a map, answers questions and takes changes."""
