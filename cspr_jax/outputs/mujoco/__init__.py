"""MuJoCo: a plan as a model with tensions, and played."""
