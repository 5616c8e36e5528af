"""What all commands share: exit codes, options, errors, output and signals."""
