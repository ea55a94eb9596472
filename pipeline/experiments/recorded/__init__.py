"""Experiments recorded earlier on frames that are not kept, read again."""
