"""Keys of tables that plans, sweeps and robot files share."""
