"""Tileable procedural textures: albedo and relief of everything a scene is covered with."""

from __future__ import annotations

from pipeline.scenes.textures.library import Library, library
from pipeline.scenes.textures.texture import Texture

__all__ = ["Library", "Texture", "library"]
