"""How the program ends."""

DONE, SOME_FAILED, UNUSABLE, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: all done; some photos failed; wrong usage or unusable input; stopped by Ctrl-C."""
