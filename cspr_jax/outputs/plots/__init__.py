"""Pictures of results: sections, lines and solids of maps, motions over time and in space, and pages for browsers."""
