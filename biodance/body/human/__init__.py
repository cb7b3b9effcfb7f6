"""The 12-segment human: skeleton, joint centres, scaling on the static trial, limits."""
