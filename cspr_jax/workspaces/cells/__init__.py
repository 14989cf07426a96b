"""Proofs of full cells of a workspace: inside, outside, clearances, speeds.

Files, each importing only from those above it:

    worst_facet_normals   the facet normal with the smallest slack at a pose
    shifts                largest movements of cables within a cell
    cells                 boxes of positions, and bounds over them
    inside_cells          cells in which tensions stay within limits at every position
    outside_cells         cells in which no tensions within limits suffice at any position
    cell_proofs           proofs of many cells
    contact_cells         clearances over cells
    speeds                speeds of cables
    whole_cells           cells of maps, halved while they are undecided
"""
