"""Pictures of maps, motions and workspaces: files, figures and films."""
