"""Reversal curves, or loops of any kind → a Preisach model of them."""
