"""Texts of a plan and a sweep that are read without mistakes."""

PLAN = """schema = 1
robot = "prototype"
z0 = 1.7
[[pose]]
rest = true
[[pose]]
position = [0.7, 0.7, 3.0]
"""
SWEEP = """schema = 1
map = "minimum-arcs"
robot = "prototype"
[axes]
x = [0.1, 0.2]
y = [0.2]
z = { start = 1.0, stop = 2.0, count = 2 }
z0 = [1.7]
[trajectory]
from = { rest = true }
"""
