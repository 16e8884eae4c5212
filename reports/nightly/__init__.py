"""Nights: measured unattended, stored, compared with what was accepted and with the nights before."""
