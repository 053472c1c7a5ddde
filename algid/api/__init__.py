"""The verbs: one module each, as a notebook calls it and as the command line calls it.

A verb takes logs, results and profiles in any form, reads, works, and writes where `out` is given.
What it gives is printed as the module's `answer` says; `report` gives answers itself.
"""
