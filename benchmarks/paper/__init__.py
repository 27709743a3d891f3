"""The paper's studies: `make paper` measures those of recipes/paper/ and draws the pictures of docs/paper.md."""
