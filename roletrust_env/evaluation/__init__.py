"""Evaluation: how an attack is named, found and measured."""
