"""Synthetic projects: carved and painted stone, photographed by a small ray caster."""

from texproj.demo.make import DemoPhoto, DemoProject, make_demo
from texproj.demo.write import write_demo, write_lit_demo

__all__ = ["DemoPhoto", "DemoProject", "make_demo", "write_demo", "write_lit_demo"]
