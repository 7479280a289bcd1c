"""The ground, and the condensed problem of unilateral contact with set-valued friction with its solver.

Rods and solids both stand on this and on nothing else of each other: how their bodies move is each one's own.
"""
