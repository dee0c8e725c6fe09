"""The inner loops in C, compiled once where there is a compiler.

Everything here has a counterpart in Python that gives the same numbers, bit for bit, and runs where there is no
compiler, or where ``GMR_TRAJ_CC=none`` asks for it.
"""
