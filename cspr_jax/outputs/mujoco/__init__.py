"""MuJoCo: plans written as models with tensions, and plans played in its simulation."""
