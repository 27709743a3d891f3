"""The self-test's recipe, and the digests that it must give: `.lock` for what is made, `.files` for what is written."""
