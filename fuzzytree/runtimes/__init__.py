"""What can execute a model, one module per runtime."""
