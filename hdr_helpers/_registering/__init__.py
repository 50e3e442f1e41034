"""Behind align.py: how photographs of one scene are laid on each other.

matching     a photograph and its neighbours   ->  the first match that can be trusted, along the chain
blocks       two pictures, a guess             ->  where small blocks of one are found in the other; what they agree on
correlation  two nearly black or white ones    ->  a guess where bitmaps have none
motion       a shift and a small turn          ->  moved points, moved pictures, the part that all pictures show
"""
