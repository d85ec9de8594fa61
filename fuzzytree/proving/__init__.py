"""What is true of a rule base everywhere on a domain: proofs, witnesses, brackets."""
