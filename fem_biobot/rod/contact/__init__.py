"""Unilateral contact with set-valued friction: the condensed problem at the contact points, and its solver."""
