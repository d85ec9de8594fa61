"""What changed between two models, and where they decide differently.

In reading order:

- `difference_records`: a change, its grade, and the whole difference
- `matching`: which rule corresponds to which, by content
- `structure`: changes of rules, classes, variables and terms
- `agreement`: do two models decide alike everywhere
- `regions`: a box on which they differ
- `decisions`: where two models decide differently
- `system_keys`, `system_bounds`, `system_numbers`: how a system computes an output; its
  number in fractions, and how far two can be apart; what is known of both
- `system_differences`: the same for fuzzy systems
- `differences`: all of it, for two models
"""
