"""What effects are made of: the contract of the family (Case, Effect, DiscreteEffect), and what several causes
share.
"""
