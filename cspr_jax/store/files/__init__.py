"""Files on a disk: whole or not at all, with checksums, in netCDF-4 layout."""
