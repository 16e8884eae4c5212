"""Sweeps: tables of independent cells, played in parallel, kept in a store, and never measured twice."""
