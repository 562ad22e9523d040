"""Columns whose values are arrays, such as the corners of a polygon: rows hold numbers, a pool the arrays.

``column`` is the field of a component, ``pool`` keeps each array once and forgets those that nothing holds any more.
"""
