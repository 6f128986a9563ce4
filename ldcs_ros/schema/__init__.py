"""The content of files that people write: fields with unit and bounds, and the strict reader of YAML."""
