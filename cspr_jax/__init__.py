"""What a cable-suspended parallel robot can reach when it swings, and how."""
