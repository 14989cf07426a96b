"""Check certificates, by docs/certificates.md, independently of the program that writes them, with python-flint alone.

Files import only from those before them: reading, series, state, criteria, checking.
"""
