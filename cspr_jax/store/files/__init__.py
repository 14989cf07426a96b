"""Files on a disk: complete or absent, with checksums, in netCDF-4 layout."""
