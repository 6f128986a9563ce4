"""What a person may write into a file: fields with unit and bounds, and the reader of YAML."""
