"""Maps become messages, and messages what a map understands."""
