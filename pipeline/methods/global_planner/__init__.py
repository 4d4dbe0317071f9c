"""The Global Kinematic Planner: many coarse starts, each distinct optimum refined."""
