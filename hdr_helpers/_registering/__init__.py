"""Behind align.py: how photographs of one scene are laid on each other.

motion    a shift and a small turn   ->  moved points, moved pictures, the part that all pictures show
blocks    two pictures, a guess      ->  where small blocks of one are found in the other, and what they agree on
"""
