"""The grammar of questions in English: from tokens to a `Query`.

`english.lark` says which sentences there are, and names their rules. `reading` parses by it, and
turns each rule into its meaning by the method with its name: in `sentences` for questions about
objects and times, in `rooms` for those about rooms, and in `phrases` for what these are made of.
"""

from hypermap.questions.grammar.reading import query_of

__all__ = ["query_of"]
