"""The findings of an audit: one module for each family of questions.

An audit
    - `records`: an audit, its answers and settings; `codes`: every question and reason
    - `subject`: the model and its rules, as each family receives them
    - `audit`: runs all families within the budget
    - `domains`: where rows lie, in the words of their table
    - `locations`: where rules stand in a file; ids that do not depend on their order
    - `configuration`, `results`: settings, accepted findings, results of other verbs

Families
    - `deciding`: does a rule ever win, by how much, does it tie; is every input covered
    - `pairs`: rules that hide, copy or contradict each other; propositions to no effect
    - `terms`: terms that are not reached, ill shaped or hard to distinguish; counts
    - `leaves`: where each leaf of a tree decides, and where its raw rules differ
    - `robustness`: how far rows are from another decision, and from gaps
    - `support`: what rows show; shares of the domain
    - `representations`: do all representations and runtimes agree
"""
