"""What is true of a rule base everywhere on a domain: proofs, witnesses, brackets.

Every number is a fraction; doubles only exclude, rounded outwards. A function takes the
rules on a box (`arrangement`) and the numbers of rules, from 1, and returns one of the
six `states`; without a `clock` it has no time limit. In reading order:

Terms
    - `states`: the six states of a result, claims, coordinates, regions; wording
    - `domain`: the box, and the values of variables on it
    - `clock`: a budget of time, and how it is shared

Degrees along an axis (as lines: `fuzzytree.auditing.decide`)
    - `measures`: distances of functions of lines
    - `polynomials`, `pieces`: membership functions as polynomials, and bounds of
      degrees by doubles

Points
    - `linear`, `witnesses`: linear inequalities; from values of axes to inputs
    - `probes`: random points and local search, by doubles

Rules
    - `arrangement`: what rules ask of each axis on a box
    - `levels`: under the minimum, which rules reach a level that others do not
    - `compared`: two rules, for the minimum and the product
    - `space`, `bounding`: boxes of inputs; branch and bound, for any AND operator

Questions
    - `questions`: does a rule win, by how much, does it tie; is every input covered
    - `decisions`, `nearest`, `regions`: does one class decide a box; the distance to
      another decision; the crisp regions of a tree
    - `contenders`, `equivalence`: do two models predict the same class everywhere
"""
