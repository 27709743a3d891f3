"""`python -m recipe_cli` is `recipe`."""

from recipe_cli.entry import main

if __name__ == "__main__":
    main()
