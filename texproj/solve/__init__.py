"""Pure numerics: least squares, poses, matching, mutual information. No files, no GL."""
