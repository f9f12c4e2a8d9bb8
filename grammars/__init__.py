"""Formal indoor grammars: their form, reader, checks and generator (Sec. 4.2)."""
