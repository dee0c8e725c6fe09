"""The version, in one place: the build reads it from here and the command prints it."""

__version__ = "0.1.0"
