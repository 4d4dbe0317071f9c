"""One file or folder per method; each answers method(problem, options, context) with its solutions (`registry.py`)."""
