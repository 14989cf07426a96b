"""Properties that must hold for any robot and any points."""
