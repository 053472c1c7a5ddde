"""The verbs: one module each, as a notebook calls it and as the command line calls it.

A verb takes logs, results and profiles in any form, reads, works, and writes where `out` is given.
What it gives can be printed by the module's `document` or `tables` and `as_json`, where there are.
"""
