"""Shared foundations: Traces, transforms, files, codecs and versions."""
