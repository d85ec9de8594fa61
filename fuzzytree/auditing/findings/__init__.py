"""What is odd in a rule base: one module for each family of questions.

In reading order:

An audit
    - `records`: an audit, its answers and settings, as frozen values
    - `codes`: every question and reason, with a stable code
    - `subject`: what is audited, as each family gets it
    - `audit`: asks all families, one after another
    - `domains`, `views`, `conditions`: where a model is asked, and its rules as a rule
      base; conditions of fuzzy systems as clauses
    - `system_terms`, `enclosing`, `hedging`: the terms of fuzzy systems; curves and
      hedged ones between two lines of points
    - `held`, `sides`: rules with such terms and with weights, from below and from
      above; what is asked of which
    - `turns`: many questions share what is left of the time
    - `places`: where rules stand in a file; ids that outlive their order
    - `results`: what other verbs found of the same model
    - `limits`: what an audit does not establish, and its digest

What a user chooses
    - `selecting`: codes and settings
    - `configuration`: the same from a file
    - `baselines`: findings that are accepted

Families, each with `answers(subject)`
    - `deciding`: does a rule ever win, by how much, does it tie
    - `gaps`: inputs that no rule covers, or none well
    - `pairs`, with `clauses`: two rules that hide, copy or contradict each other;
      clauses that nothing needs
    - `terms`, `shapes`, `overlaps`, with `ranges`: terms that are not reached or not
      used, ill shaped, hard to tell apart
    - `complexity`: counts, and the index of Nauck
    - `trees`: what each leaf decides
    - `deciders`: models that decide, and how far another decision is
    - `disagreement`, with `rows` and `nearby`: where a tree and its raw rules part, and
      how near to rows
    - `robustness`: how far a row is from another decision
    - `support`: what rows say; shares of the domain
    - `representations`, with `conventions`: do all forms and runtimes answer alike
"""
