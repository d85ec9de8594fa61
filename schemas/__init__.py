"""JSON Schemas of the files that fuzzytree reads and writes."""
