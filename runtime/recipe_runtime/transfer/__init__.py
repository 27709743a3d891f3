"""Datasets and recipes in other places and forms: uploads, downloads, WebDataset shards, packs."""
