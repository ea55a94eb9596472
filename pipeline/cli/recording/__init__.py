"""What commands that record share: their options and configuration, and the experiments on frames of one's own."""
