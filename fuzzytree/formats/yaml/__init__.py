"""Our own YAML files."""
