"""The paper's sentences beside our measurements: `claim` defines a claim, a file for each field lists its claims."""
