"""The camera in the loop, simulated: views, scenarios, the loop, scores, and the paper's worked examples."""
