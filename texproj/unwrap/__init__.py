"""A mesh laid flat: regions, charts without folds, and their places on the pages of a texture."""
