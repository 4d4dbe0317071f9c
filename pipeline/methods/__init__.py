"""One file per method; each answers solve(problem, options) with one Solution or several."""
