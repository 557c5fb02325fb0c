"""Shared basics that import no other part: file access, threads, processes, the start of Warp, rigid motion, poses."""
