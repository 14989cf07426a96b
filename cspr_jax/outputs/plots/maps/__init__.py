"""Pictures of maps and workspaces."""
