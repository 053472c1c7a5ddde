"""`python -m algid`."""

from algid.cli import main

main()
