"""Programs whose solution is a smooth curve: the C2 cubic spline that is exported."""
