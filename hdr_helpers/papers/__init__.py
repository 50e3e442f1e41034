"""The reading list in code: one paper a file, arrays in, arrays out, no import of a stage."""
