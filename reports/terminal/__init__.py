"""Tables and progress on a terminal; plain lines elsewhere."""
