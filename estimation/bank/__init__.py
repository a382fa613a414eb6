"""Estimates linear in their weights over products of physical states."""
