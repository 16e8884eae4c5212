"""Metamorphic relations: changes of a scene whose effect on the motion is known without its answer."""
