"""What changed between two models, and where they decide otherwise.

In reading order:

- `difference_records`, `drafting`: a change, and what grades it
- `matching`: which rule is which, by what it says
- `structure`, `structure_terms`: what is said otherwise
- `decisions`: where two models decide otherwise
- `system_meanings`, `system_bounds`, `system_numbers`: what an output is computed
  by; its number in fractions, and how far two can be apart; what is known of both
- `system_differences`: the same for fuzzy systems
- `differences`: all of it, of two models
"""
