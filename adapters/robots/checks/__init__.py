"""Checks of a robot's file: what plays otherwise than its author meant, with the remedy."""
