"""How the program ends; where it is stopped on request, see `texproj.cli.STOPPED`."""

DONE, SOME_FAILED, UNUSABLE = 0, 1, 2
"""Exit codes: all done; some photos failed; wrong usage or unusable input."""
