"""What is true of a rule base everywhere on a domain: proofs, witnesses, brackets.

Every number is a fraction; doubles only sort out, rounded outwards. In reading order:

What is asked and answered
    - `states`: the five states of an answer, claims, coordinates, regions
    - `domain`: the box on which everything is asked
    - `clock`: a budget of time, and how it is shared
    - `variables`: a variable at a point, its ends on a box, its weights
    - `wording`: counts, numbers and names as sentences show them

Curves, in fractions
    - `polynomials`: their roots, isolated in integers
    - `curves`: shapes as polynomials on intervals
    - `elements`, `crowds`: the curves of one axis, and where something changes; how
      often many of them cross
    - `axes`: an axis cut into cells in which no order changes
    - `measures`, `overlap`, `defects`, `distances`: heights and areas; what two curves
      share; dips and clipping; how far two curves are apart
    - `ranges`: enclosures of degrees on intervals, by doubles

Points
    - `linear`: linear inequalities, decided in fractions
    - `witnesses`: from values of the axes to a point of the inputs
    - `seeking`, `glimpses`: points worth a look, by doubles; what many show at once
    - `around`: what rules reach on many boxes at once, by doubles
    - `boxes`: the region around a witness

Rules under the minimum: levels
    - `ground`: a rule base on a box; cells and critical levels of all axes
    - `levels`: irrational levels that coincide
    - `contests`, `parts`: the options of each axis, and the values where one holds
    - `covering`: a choice on each axis that leaves all rivals below
    - `choices`: values that axes which share inputs have together
    - `questions`: the search for a point at which a level parts rules from rivals

Rules under the product, and any other: boxes
    - `lines`, `space`: parts of inputs, and boxes of them, bounded by doubles
    - `branching`: the most promising boxes are parted first
    - `bounding`: what rules reach on a domain, by boxes

Questions, whatever the conjunction
    - `wins`, `leads`: is a rule ever strongest, and by how much
    - `tied`, `shared`, `pivots`, `ties`, `tied_inputs`: are rules equally strong on a
      set with an interior
    - `proportions`, `products`: where are they one function, under the product
    - `cover`: is there an input without a rule, or with weak ones only
    - `factors`, `dominance`: two rules compared axis by axis
    - `meeting`: the highest level that two rules both reach
    - `decisions`: is a box decided alike everywhere
    - `nearest`: how far it is to the nearest point of a kind
    - `regions`: the crisp regions of a tree
    - `polytopes`: how far the nearest of them is where combinations are asked

Two models
    - `answers`: what a rule base answers at a point; where two differ
    - `stretches`, `contenders`, `points`: clauses, rules and points on parts of axes
      that both models share
    - `alike`: do both decide alike everywhere
"""
