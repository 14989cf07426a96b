"""Files that are complete or absent, with checksums, in netCDF-4 layout."""
