"""The console of the map server, for the shell of the command line and for nodes.

`commands` takes a line of text and returns the answer; it knows no terminal. `prompt` brings what
someone types at a terminal, and `completion` what the Tab key offers there. `questions` answers
those of `hypermap query`, here and there; `options` is how they are spelled.
"""
