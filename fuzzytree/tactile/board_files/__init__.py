"""Board descriptions as YAML files."""
