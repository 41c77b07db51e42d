"""What a run gives: measurements, the table, provenance, and the folder it is stored in."""
