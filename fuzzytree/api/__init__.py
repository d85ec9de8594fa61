"""The functions behind `import fuzzytree`, one for each verb."""
