"""The stages: what depends on what, and which of it is stale. One function a stage, called alike
by the command line, the web page and tests.
"""
