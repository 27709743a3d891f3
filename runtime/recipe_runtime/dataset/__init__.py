"""What a dataset's folder holds: its manifest, texts and digests, and the reader of any dataset."""
