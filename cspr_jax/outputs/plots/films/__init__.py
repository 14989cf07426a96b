"""Films of motions, and pictures of replays in MuJoCo."""
