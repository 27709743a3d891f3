"""Files of a dataset for catalogues and search engines."""
