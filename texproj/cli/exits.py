"""How the program ends."""

import threading

DONE, SOME_FAILED, UNUSABLE, STOPPED = 0, 1, 2, 130
"""Exit codes: all done; some photos failed; wrong usage or unusable input; stopped on request, by
Ctrl-C or with SIGTERM."""

STOP = threading.Event()
"""Set when somebody asked to stop: an exception alone can get lost where a library swallows it."""
