"""The recipe of the self-test and its golden digests.

`.lock` for the stages' results, `.files` for the written files.
"""
