"""Published results of other projects, each with its source, compared with what engines and exact solutions give here and now."""
