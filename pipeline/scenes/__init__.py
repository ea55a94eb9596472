"""The *Sim* dataset: procedural streets and villages, ray cast with exact boxes, motion and a known lens."""
