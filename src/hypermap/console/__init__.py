"""Queries as text: the map server's console, `hypermap shell`, and the options of `hypermap query`.

`options` lists the options of a query, `questions` turns them into a `Query` and its answer into
rows, and `answer` shows the rows; the command `query` uses these three alone. `commands` takes a
line of text and returns the answer as text, without a terminal. `prompt` reads lines from a
terminal, and `completion` is what the Tab key offers there.
"""
