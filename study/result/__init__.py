"""The result file: what stands where, how it is written by many ranks, read and checked."""
