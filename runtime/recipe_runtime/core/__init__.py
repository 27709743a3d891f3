"""What every other package uses: Traces, transforms, files, codecs and versions."""
