"""Inequalities: contact, friction and joint limits."""
