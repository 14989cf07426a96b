"""Films of motions, and replays."""
