"""The paper's studies: `make paper` renders the recipes of recipes/paper/, measures, and draws docs/paper/."""
