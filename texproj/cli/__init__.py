"""The command line: it parses, calls a stage, and says what came of it."""

from texproj.cli.main import main

__all__ = ["main"]
