"""Results as sentences and table rows, without HTML and terminal codes; one file for each command."""
