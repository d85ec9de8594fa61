"""Rules and systems as a fixed sequence of operations, the same in every target."""
