"""The findings of an audit: one module for each family of questions.

In reading order:

An audit
    - `records`: an audit, its answers and settings, as frozen values
    - `codes`: every question and reason, and the families that answer them
    - `subject`: the model and the settings, as each family receives them
    - `audit`: runs all families within the budget
    - `domains`, `views`: the domain; the rules of a model as an audit sees them
    - `table_words`: values of inputs as their table has them, shown and read
    - `locations`: where rules stand in a file; ids that do not depend on their order
    - `results`, `baselines`, `configuration`: results of other verbs, accepted findings
      and settings, from files

Families
    - `deciding`: does a rule ever win, by how much, does it tie
    - `gaps`: inputs that no rule covers, or none covers well
    - `pairs`, `propositions`: two rules that hide, copy or contradict each other;
      propositions without effect
    - `terms`: terms that are not reached or not used, ill shaped, hard to distinguish
    - `complexity`: counts, and the index of Nauck
    - `leaves`: where each leaf of a tree decides
    - `robustness`, `rows`: how far a row is from another decision
    - `disagreement`: where a tree and its raw rules differ, and how near to rows
    - `support`: what rows show; shares of the domain
    - `representations`, `conventions`: do all representations and runtimes agree
"""
