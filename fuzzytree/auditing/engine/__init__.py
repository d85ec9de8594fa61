"""What is true of a rule base everywhere on a domain: proofs, witnesses, brackets.

Every number is a fraction; doubles only exclude, rounded outwards. A function takes the
rules on a box (`arrangement`) and the numbers of rules, from 1, and returns one of the
six `states`; without a `clock` it has no time limit. In reading order:

Terms
    - `states`: the six states of a result, claims, coordinates, regions; wording
    - `domain`: the box, and the values of variables on it
    - `clock`: a budget of time, and how it is shared

Curves, in fractions
    - `polynomials`, `pieces`: roots, isolated in integers; membership functions as
      polynomials on intervals, and bounds of degrees by doubles
    - `axes`: an axis cut into cells; irrational levels that coincide
    - `measures`: heights, areas, overlaps

Points
    - `linear`, `witnesses`: linear inequalities; from cells to points of the inputs
    - `probes`: random points and local search, by doubles

Rules under the minimum: levels of cells
    - `arrangement`: the axes on a box
    - `duels`: the contribution of each axis; is a rule stronger
    - `pivots`, `ties`: curves at which rules can tie; are rules equally strong

Rules under the product, and any other: boxes
    - `space`, `bounding`: boxes of inputs; branch and bound
    - `factors`, `product_ties`: degrees as products of polynomials; ties

Questions, for each AND operator
    - `cover`, `dominance`: does any rule fire; two rules compared
    - `decisions`, `nearest`, `regions`: does one class decide a box; the distance to
      another decision; the crisp regions of a tree
    - `contenders`, `equivalence`: do two models predict the same class everywhere
"""
