"""Axial members, loads, joints and contact points: their forces and derivatives."""
